"""The server of the page, on 127.0.0.1 only: each visitor has a session, stepped in real time by its own thread."""

from __future__ import annotations

import contextlib
import io
import logging
import socket
import threading
import time
import traceback
import warnings
import webbrowser
from collections.abc import Iterator

import torch
import viser

from envs.body.segments import Segments, read_segments
from posture.config.errors import ConfigError
from posture.config.play import PlayConfig
from posture.config.published import read_published
from posture.play.panel import Panel
from posture.play.plots import Plots
from posture.play.policies import PolicyChoice, policy_choices
from posture.play.scene import Scene, aim_camera
from posture.play.session import Session
from posture.play.theory_worker import TheoryWorker

HOST = "127.0.0.1"
MAX_LAG_S = 0.25
"""A slow machine catches up with at most this much lost time."""


def serve(config: PlayConfig) -> None:
    """Print the address and serve the page until the process is stopped.

    Raises ConfigError if the port is in use or the checkpoint is not usable.
    """
    check_port(config.port)
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
    """port: that of the page. visitors: those connected, by client number."""

    def __init__(self, config: PlayConfig, policies: list[PolicyChoice], worker: TheoryWorker) -> None:
        torch.set_num_threads(1)
        self._config, self._policies, self._worker = config, policies, worker
        self._body = read_segments(policies[0].env)
        self._lock = threading.Lock()
        self.visitors: dict[int, Visitor] = {}
        logging.getLogger("websockets").setLevel(logging.CRITICAL)
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection")  # a visitor left between two frames
        self._server = quiet_server(config.port)
        self.port = self._server.get_port()
        if config.port not in (0, self.port):
            self.close()  # viser took the next free port
            raise ConfigError(port_in_use(config.port))
        # Viser can share a page through a server on the internet; this page stays on this machine.
        self._server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
        aim_camera(self._server.initial_camera)
        self._server.on_client_connect(self._connect)
        self._server.on_client_disconnect(self._disconnect)

    def close(self) -> None:
        """Disconnect all visitors and stop."""
        for visitor in list(self.visitors.values()):
            visitor.stop()
        stop_quietly(self._server)

    def _connect(self, client: viser.ClientHandle) -> None:
        with self._lock:
            if len(self.visitors) >= self._config.visitors:
                client.gui.add_markdown(
                    f"{self._config.visitors} visitors are connected already, the most allowed (`visitors=`). "
                    "Reload the page when one has left."
                )
                return
            visitor = Visitor(client, self._config, self._policies, self._body, self._worker)
            self.visitors[client.client_id] = visitor
            visitor.start()

    def _disconnect(self, client: viser.ClientHandle) -> None:
        visitor = self.visitors.pop(client.client_id, None)
        if visitor is not None:
            visitor.stop()


class Visitor(threading.Thread):
    """One visitor's page. session: their stander. frames: number of frames sent, for benchmarks."""

    def __init__(
        self,
        client: viser.ClientHandle,
        config: PlayConfig,
        policies: list[PolicyChoice],
        body: Segments,
        worker: TheoryWorker,
    ) -> None:
        super().__init__(daemon=True)
        self._client, self._config = client, config
        self.session = Session(config, policies, body, worker)
        self.frames = 0
        self.lock = threading.Lock()
        """Held while the session changes."""
        self._stopped = threading.Event()
        gui = client.gui
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(0, 114, 178))
        gui.set_panel_label("posture")
        measurements = gui.add_panel()
        with measurements.add_tab("measurements"):
            self._plots = Plots(gui, config, self.session.sole)
        measurements.dock_left()
        measurements.set_width(400)
        self.panel = Panel(
            gui,
            self.session,
            config,
            [policy.name for policy in policies],
            self.lock,
            lambda text: client.add_notification("not possible", text, color="red"),
        )
        gui.main_panel.dock_right()
        gui.main_panel.set_width(310)
        aim_camera(client.camera)
        self._scene = Scene(client.scene, self.session.sole, read_published().table_1.target_height_m)

    def stop(self) -> None:
        """End the thread after its present step."""
        self._stopped.set()

    def run(self) -> None:
        """Step the session and draw it until the visitor leaves."""
        torch.set_num_threads(1)
        try:
            self._loop()
        except Exception as error:
            if not self._stopped.is_set():
                traceback.print_exc()
                message = f"{type(error).__name__}: {error}; reload the page"
                self._client.add_notification("stopped", message, color="red")

    def _loop(self) -> None:
        session, config = self.session, self._config
        last = next_frame = next_plots = time.monotonic()
        owed = 0.0  # simulated time still to be stepped [s]
        while not self._stopped.is_set():
            now = time.monotonic()
            owed = min(owed + (now - last) * self.panel.speed, MAX_LAG_S)
            last = now
            with self.lock:
                while owed >= session.dt:
                    session.step()
                    owed -= session.dt
                if now >= next_frame:
                    next_frame = max(next_frame + 1 / config.frames_per_s, now - MAX_LAG_S)
                    self._draw_scene()
                if now >= next_plots:
                    next_plots = max(next_plots + 1 / config.plots_per_s, now)
                    self._draw_plots()
            next_event = min(next_frame, next_plots, now + (session.dt - owed) / self.panel.speed)
            self._stopped.wait(max(0.001, next_event - time.monotonic()))

    def _draw_scene(self) -> None:
        settings = self.session.settings
        with self._client.atomic():
            self._scene.show(self.session.state, settings.tolerance, settings.load)
        self.frames += 1

    def _draw_plots(self) -> None:
        session = self.session
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


def check_port(port: int) -> None:
    """Raise ConfigError if `port` is in use or needs more rights."""
    with socket.socket() as test:
        test.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            test.bind((HOST, port))
        except PermissionError:
            raise ConfigError(f"port = {port}: this user may not listen there; allowed are 1024 and above") from None
        except OSError:
            raise ConfigError(port_in_use(port)) from None


def port_in_use(port: int) -> str:
    """The error message."""
    return f"port = {port}: in use on this machine; choose another, such as port={port + 1}, or port=0 for any free one"
