"""The server of the page, on 127.0.0.1 only: each visitor has a session, stepped in real time by its own thread."""

from __future__ import annotations

import contextlib
import io
import logging
import threading
import time
import traceback
import warnings
import webbrowser
from collections.abc import Callable, Iterator
from functools import partial
from queue import SimpleQueue

import torch
import viser

from envs.body.segments import read_segments
from posture.config.errors import ConfigError
from posture.config.play import PlayConfig
from posture.play.address import HOST, port_in_use
from posture.play.panel import Panel
from posture.play.plots import Plots
from posture.play.policies import PolicyChoice, policy_choices
from posture.play.scene import Scene, aim_camera
from posture.play.session import Session
from posture.play.theory_worker import TheoryWorker

MAX_LAG_S = 0.25
"""A slow machine catches up with at most this much lost time."""
MAX_WAIT_S = 5.0
"""Longest wait for a session to end when the server is closed."""


def serve(config: PlayConfig) -> None:
    """Print the address and serve the page until the process is stopped.

    Raises ConfigError if the port is in use or the checkpoint is not usable.
    """
    with running(config, policy_choices(config.ckpt, config.lqr)) as server:
        print(f"posture: http://{HOST}:{server.port} (press Ctrl-C to stop)", flush=True)
        if config.browser and not webbrowser.open(f"http://{HOST}:{server.port}"):
            print("no browser could be opened; open the address yourself", flush=True)
        while True:
            time.sleep(1.0)  # until a signal


@contextlib.contextmanager
def running(config: PlayConfig, policies: list[PolicyChoice]) -> Iterator[Server]:
    """A server that is closed at the end of the context."""
    worker = TheoryWorker()
    try:
        server = Server(config, policies, worker)
        try:
            yield server
        finally:
            server.close()
    finally:
        worker.close()


class Server:
    """port: that of the page. visitors: their threads, by client number.

    Viser reports in its event loop who comes and who leaves, in order, so this needs no lock. A visitor's place is free as
    soon as they leave or their session fails; their thread removes itself when it ends.
    """

    def __init__(self, config: PlayConfig, policies: list[PolicyChoice], worker: TheoryWorker) -> None:
        torch.set_num_threads(1)
        first = policies[0]
        first.env_with(config.body.apply_to(first.env.body))  # reports a body that cannot be used before a visitor comes
        self._config = config
        self._make_session = partial(Session, config, policies, read_segments(first.env), worker)
        self.visitors: dict[int, Visitor] = {}
        logging.getLogger("websockets").setLevel(logging.CRITICAL)
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection")  # a visitor left between two frames
        self._server = quiet_server(config.port)
        self.port = self._server.get_port()
        if config.port not in (0, self.port):
            self.close()  # viser took the next free port
            raise port_in_use(config.port)
        # Viser can share a page through a server on the internet; this page stays on this machine.
        self._server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
        aim_camera(self._server.initial_camera)
        self._server.on_client_disconnect(self._disconnect)
        self._server.on_client_connect(self._connect)

    def close(self) -> None:
        """Stop the server and end all sessions."""
        stop_quietly(self._server)
        visitors = list(self.visitors.values())
        for visitor in visitors:
            visitor.stop()
        for visitor in visitors:
            visitor.join(MAX_WAIT_S)

    async def _connect(self, client: viser.ClientHandle) -> None:
        if client.client_id not in self._server.get_clients():
            return  # a page that was open before the server started, and was closed while it did
        if sum(not visitor.stopped for visitor in list(self.visitors.values())) >= self._config.visitors:
            client.gui.add_markdown(
                f"{self._config.visitors} visitors are connected already, the most allowed (`visitors=`). "
                "Reload the page when one has left."
            )
            return
        visitor = Visitor(client, self._config, self._make_session, self._remove)
        self.visitors[client.client_id] = visitor
        visitor.start()

    async def _disconnect(self, client: viser.ClientHandle) -> None:
        if visitor := self.visitors.get(client.client_id):
            visitor.stop()

    def _remove(self, client_id: int) -> None:
        self.visitors.pop(client_id, None)


class Visitor(threading.Thread):
    """One visitor's page and their stander, which only this thread uses.

    Whatever the visitor does on the page becomes a command, carried out between two steps. An error, also while the session
    is made, is shown on the page and ends the thread. session: None until it is made. frames: number sent, for benchmarks.
    """

    _one_at_a_time = threading.Lock()
    """Held while a session is made: pages that are reloaded quickly must not load policies and kernels all at once."""

    def __init__(
        self,
        client: viser.ClientHandle,
        config: PlayConfig,
        make_session: Callable[[], Session],
        on_end: Callable[[int], None],
    ) -> None:
        super().__init__(daemon=True)
        self._client, self._config, self._make_session, self._on_end = client, config, make_session, on_end
        self._stop_requested = threading.Event()
        self._commands: SimpleQueue[Callable[[], object]] = SimpleQueue()
        self.session: Session | None = None
        self.frames = 0

    @property
    def stopped(self) -> bool:
        """Whether the visitor has left, or the session has failed."""
        return self._stop_requested.is_set()

    def stop(self) -> None:
        """End the thread after its present step."""
        self._stop_requested.set()

    def command(self, action: Callable[[], object]) -> None:
        """Carry out `action` between two steps, in the visitor's thread. A ConfigError is shown on the page."""
        self._commands.put(action)

    def run(self) -> None:
        """Make the session, step and draw it until the visitor leaves."""
        torch.set_num_threads(1)
        try:
            with self._one_at_a_time:
                if self.stopped:
                    return
                self.session = self._make_session()
                self._build_page(self.session)
            self._loop(self.session)
        except Exception as error:
            if not self.stopped:
                text = str(error)
                if not isinstance(error, ConfigError):
                    traceback.print_exc()
                    text = f"{type(error).__name__}: {error}"
                self._show_error("stopped", f"{text}; reload the page")
        finally:
            self.stop()
            self._on_end(self._client.client_id)

    def _build_page(self, session: Session) -> None:
        client, config, gui = self._client, self._config, self._client.gui
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(0, 114, 178))
        gui.set_panel_label("posture")
        measurements = gui.add_panel()
        with measurements.add_tab("measurements"):
            self._plots = Plots(gui, config, session.sole)
        measurements.dock_left()
        measurements.set_width(400)
        self.panel = Panel(gui, session, config, self.command)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(310)
        aim_camera(client.camera)
        self._scene = Scene(client.scene, session.sole, session.settings.body)

    def _show_error(self, title: str, text: str) -> None:
        self._client.add_notification(title, text, color="red")

    def _loop(self, session: Session) -> None:
        config = self._config
        last = next_frame = next_plots = time.monotonic()
        owed = 0.0  # simulated time still to be stepped [s]
        while not self.stopped:
            self._run_commands()
            now = time.monotonic()
            owed = min(owed + (now - last) * self.panel.speed, MAX_LAG_S)
            last = now
            while owed >= session.dt:
                session.step()
                owed -= session.dt
            if now >= next_frame:
                next_frame = max(next_frame + 1 / config.frames_per_s, now - MAX_LAG_S)
                self._draw_scene(session)
            if now >= next_plots:
                next_plots = max(next_plots + 1 / config.plots_per_s, now)
                self._draw_plots(session)
            next_event = min(next_frame, next_plots, now + (session.dt - owed) / self.panel.speed)
            self._stop_requested.wait(max(0.001, next_event - time.monotonic()))

    def _run_commands(self) -> None:
        while not self._commands.empty():  # only this thread takes commands out
            try:
                self._commands.get()()
            except ConfigError as error:
                self._show_error("not possible", str(error))

    def _draw_scene(self, session: Session) -> None:
        with self._client.atomic():
            settings = session.settings
            if self._scene.person != settings.body:
                self._scene = Scene(self._client.scene, session.sole, settings.body)
            self._scene.show(session.state, settings.tolerance, settings.load, session.load_at)
        self.frames += 1

    def _draw_plots(self, session: Session) -> None:
        self._plots.refresh(session)
        mode = session.measures().mode
        self._scene.show_mode(mode, "fallen" if session.fallen else f"{mode}, {session.settings.freq:.2f} Hz")
        self.panel.refresh()


def quiet_server(port: int) -> viser.ViserServer:
    """A server of viser that does not print its addresses."""
    with contextlib.redirect_stdout(io.StringIO()):
        return viser.ViserServer(HOST, port, verbose=False)


def stop_quietly(server: viser.ViserServer) -> None:
    """Stop `server` without its message."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()
