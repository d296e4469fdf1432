"""The server with visitors that speak viser's protocol without a browser: who has a place, what their controls do."""

import contextlib
import threading
import time
from concurrent.futures import Future

import msgspec
import pytest
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from posture.config.errors import ConfigError
from posture.play import server as server_module
from posture.play.server import Server
from tests.posture.play.sessions import compose_play, policies

CAMERA = {"wxyz": [1, 0, 0, 0], "position": [0, -3, 1], "fov": 0.7, "near": 0.1, "far": 100, "image_height": 9}
CAMERA |= {"image_width": 9, "look_at": [0, 0, 1], "up_direction": [0, 0, 1], "type": "ViewerCameraMessage"}
TIMEOUT_S = 60


class PendingWorker:
    """A `TheoryWorker` that never finishes."""

    def submit(self, function, *arguments):
        return Future()


class FakeSession:
    """Has no stander: it cannot be drawn, so a visitor who gets one sees an error."""


def wait(condition):
    end = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < end, "timeout"
        time.sleep(0.01)


class Page:
    """The connection of one page. client: its number. text: what the server has sent, decompressed."""

    def __init__(self, server):
        known = set(server._server.get_clients())
        self._socket = connect(f"ws://127.0.0.1:{server.port}", subprotocols=[f"viser-v{viser.__version__}"], max_size=None)
        self.text = b""
        threading.Thread(target=self._read, daemon=True).start()
        self.send(**CAMERA)
        wait(lambda: set(server._server.get_clients()) - known)
        (self.client,) = set(server._server.get_clients()) - known

    def _read(self):
        with contextlib.suppress(ConnectionClosed):
            for message in self._socket:
                length = int.from_bytes(message[8:16], "little")
                self.text += zstandard.ZstdDecompressor().decompress(message[16 : 16 + length], 1 << 24)

    def send(self, **message):
        self._socket.send(msgspec.msgpack.encode(message))

    def change(self, handle, value):
        """What the page sends when the user changes a control."""
        self.send(type="GuiUpdateMessage", uuid=handle._impl.uuid, updates={"value": value})

    def close(self):
        self._socket.close()


def visitor_of(server, page):
    wait(lambda: page.client in server.visitors)
    return server.visitors[page.client]


@contextlib.contextmanager
def serving(*overrides):
    config = compose_play("port=0", *overrides)
    server = Server(config, policies(config), PendingWorker())
    try:
        yield server
    finally:
        server.close()
    assert server.visitors == {} and not [thread for thread in threading.enumerate() if "Visitor" in type(thread).__name__]


def control(visitor, label):
    return next(h for h in visitor._client.gui._gui_input_handle_from_uuid.values() if getattr(h, "label", None) == label)


def test_controls_act_in_order_in_the_thread_of_the_session():
    with serving() as server:
        page = Page(server)
        visitor = visitor_of(server, page)
        wait(lambda: visitor.frames > 0)
        session, threads = visitor.session, set()
        set_values = session.set
        session.set = lambda **values: (threads.add(threading.current_thread()), set_values(**values))
        for freq in (0.5, 0.7, 0.9, 1.1, 0.6):
            page.change(control(visitor, "frequency [Hz]"), freq)
        wait(lambda: session.settings.freq == 0.6)
        for label, name, value in (
            ("hip stiffness [Nm/rad]", "hip_k", 60),
            ("ankle stiffness [Nm/rad]", "ankle_k", 50),
            ("load [kg]", "load", 4),
            ("amplitude [m]", "amplitude", 0.06),
            ("tolerance [m]", "tolerance", 0.02),
        ):
            page.change(control(visitor, label), value)
            wait(lambda name=name, value=value: getattr(session.settings, name) == value)
        page.change(control(visitor, "frequency [Hz]"), 9)
        wait(lambda: session.settings.freq == control(visitor, "frequency [Hz]").value == 1.5)
        assert threads == {visitor}
        page.change(control(visitor, "push [N]"), 25)
        page.change(control(visitor, "slow motion"), True)
        page.change(control(visitor, "pause"), True)
        wait(lambda: session.paused)
        assert session.push_force == 25 and visitor.panel.speed == 0.25
        time_of_pause = session.time
        page.change(control(visitor, "reset"), True)
        wait(lambda: len(session.history) == 0)
        page.change(control(visitor, "ramp down"), True)
        wait(lambda: session.ramping == -1)
        assert session.time == time_of_pause
        page.change(control(visitor, "pause"), False)
        wait(lambda: control(visitor, "frequency [Hz]").value < 1.5)  # the slider follows the ramp


def test_body_is_chosen_by_sex_mass_and_height():
    with serving() as server:
        page = Page(server)
        visitor = visitor_of(server, page)
        wait(lambda: visitor.frames > 0)
        session = visitor.session
        mass, stiffness = control(visitor, "mass [kg]"), control(visitor, "hip stiffness [Nm/rad]")
        assert mass.disabled and stiffness.max == 200
        page.change(control(visitor, "body"), "female")
        wait(lambda: session.settings.body is not None and session.settings.body.sex == "female")
        wait(lambda: not mass.disabled)
        for value in (60, 70, 80):
            page.change(mass, value)
        page.change(control(visitor, "height [m]"), 1.6)
        wait(lambda: (session.settings.body.mass, session.settings.body.height) == (80, 1.6))
        wait(lambda: visitor._scene.person == session.settings.body and stiffness.max > 200)
        assert (mass.value, control(visitor, "body").value) == (80, "female")
        page.change(control(visitor, "body"), "the paper's")
        wait(lambda: session.settings.body is None and stiffness.max == 200 and mass.disabled)


def test_body_that_is_refused_is_reported_and_the_session_continues():
    with serving("ckpt=lqr", "lqr.env.ankle_k=200") as server:
        page = Page(server)
        visitor = visitor_of(server, page)
        wait(lambda: visitor.frames > 0)
        page.change(control(visitor, "body"), "male")
        wait(lambda: b"joints scaled to this body: ankle_k" in page.text)
        wait(lambda: control(visitor, "body").value == "the paper's")
        frames = visitor.frames
        wait(lambda: visitor.frames > frames)


@pytest.mark.slow
def test_speed():
    """Real time, or a quarter of it in slow motion; never faster, slower on a busy machine."""
    with serving() as server:
        page = Page(server)
        visitor = visitor_of(server, page)
        wait(lambda: visitor.frames > 0)
        for slow, low, high in ((False, 0.7, 1.02), (True, 0.15, 0.27)):
            page.change(control(visitor, "slow motion"), slow)
            wait(lambda slow=slow: visitor.panel.speed == (0.25 if slow else 1.0))
            time.sleep(0.5)
            start, before = time.monotonic(), visitor.session.time
            time.sleep(3.0)
            assert low < (visitor.session.time - before) / (time.monotonic() - start) < high


def test_policy_that_cannot_be_loaded_is_reported_and_the_session_continues(monkeypatch):
    def damaged(*_):
        raise ConfigError("not readable")

    with serving() as server:
        page = Page(server)
        visitor = visitor_of(server, page)
        wait(lambda: visitor.frames > 0)
        monkeypatch.setattr("posture.play.policies.checkpoint.load", damaged)
        policy = control(visitor, "policy")
        page.change(policy, "pretrained/hip_k-75")
        wait(lambda: b"not readable" in page.text)
        assert policy.value == visitor.session.policy == "pretrained/default"
        frames = visitor.frames
        wait(lambda: visitor.frames > frames)


def test_session_that_fails_is_reported_and_frees_the_place(monkeypatch, capsys):
    with serving("visitors=1") as server:
        page = Page(server)
        visitor = visitor_of(server, page)
        wait(lambda: visitor.frames > 0)
        monkeypatch.setattr(visitor.session, "step", lambda: 1 / 0)
        wait(lambda: b"ZeroDivisionError: division by zero; reload the page" in page.text)
        visitor.join(TIMEOUT_S)
        assert not visitor.is_alive() and server.visitors == {}
        assert "ZeroDivisionError" in capsys.readouterr().err
        visitor_of(server, Page(server))


@pytest.mark.parametrize("error", [ConfigError("model_3.pt: not a checkpoint"), ValueError("wrong")])
def test_session_that_cannot_be_made_is_reported_and_frees_the_place(monkeypatch, capsys, error):
    def failing(*_):
        raise error

    monkeypatch.setattr(server_module, "Session", failing)
    with serving("visitors=1") as server:
        for _ in range(2):
            page = Page(server)
            wait(lambda page=page: f"{error}; reload the page".encode() in page.text)
            wait(lambda: server.visitors == {})
            page.close()
    assert ("Traceback" in capsys.readouterr().err) == isinstance(error, ValueError)


def test_pages_closed_while_their_session_is_made_leave_nothing(monkeypatch):
    begun, go_on = threading.Event(), threading.Event()

    def slow(*_):
        begun.set()
        go_on.wait(TIMEOUT_S)
        return FakeSession()

    monkeypatch.setattr(server_module, "Session", slow)
    with serving("visitors=1") as server:
        for _ in range(4):
            page = Page(server)
            visitor = visitor_of(server, page)  # each reload has the only place again
            page.close()
            wait(lambda visitor=visitor: visitor.stopped)
        threads = list(server.visitors.values())
        assert begun.is_set()
        go_on.set()
        for thread in threads:
            thread.join(TIMEOUT_S)
        assert server.visitors == {}


def test_one_visitor_too_many_sees_a_message_until_a_place_is_free(monkeypatch):
    go_on = threading.Event()
    monkeypatch.setattr(server_module, "Session", lambda *_: go_on.wait(TIMEOUT_S))
    with serving("visitors=2") as server:
        first, second = Page(server), Page(server)
        leaving = visitor_of(server, first)
        visitor_of(server, second)
        third = Page(server)
        wait(lambda: b"2 visitors are connected already" in third.text)
        assert third.client not in server.visitors
        first.close()
        wait(lambda: leaving.stopped)
        visitor_of(server, Page(server))
        go_on.set()


def test_server_is_closed_while_a_session_is_made(monkeypatch):
    begun = threading.Event()

    def slow(*_):
        begun.set()
        time.sleep(1.0)
        return FakeSession()

    monkeypatch.setattr(server_module, "Session", slow)
    with serving() as server:
        Page(server)
        begun.wait(TIMEOUT_S)
