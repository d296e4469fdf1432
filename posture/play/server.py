"""The page's server: on 127.0.0.1 alone, a session for each visitor."""

from __future__ import annotations

import contextlib
import io
import logging
import socket
import threading
import time
import warnings
import webbrowser
from collections.abc import Iterator

import torch
import viser

from posture.config.errors import ConfigError
from posture.config.play import PlayConfig
from posture.play.pilot import Candidate, candidates
from posture.play.scene import look
from posture.play.theory import Office
from posture.play.visit import Visit
from posture.theory.stander import segments

HOST = "127.0.0.1"


def serve(config: PlayConfig) -> None:
    """Print the address and serve the page until the process is stopped.

    Raises ConfigError where the port is taken or the checkpoint cannot be played with.
    """
    check_port(config.port)
    pilots = candidates(config.ckpt, config.lqr)
    with opened(config, pilots) as page:
        print(f"posture: http://{HOST}:{page.port} (Ctrl-C ends it)", flush=True)
        if config.browser and not webbrowser.open(f"http://{HOST}:{page.port}"):
            print("no browser could be opened: open the address yourself", flush=True)
        while True:
            time.sleep(1.0)  # a signal ends it


class Page:
    """The server and who is there: `visits` by client number. port: the one it got."""

    def __init__(self, config: PlayConfig, pilots: list[Candidate], office: Office) -> None:
        torch.set_num_threads(1)
        self._config, self._pilots, self._office = config, pilots, office
        self._body = segments(pilots[0].env)
        self._door = threading.Lock()
        self.visits: dict[int, Visit] = {}
        logging.getLogger("websockets").setLevel(logging.CRITICAL)  # who came, and with what, is not told
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection")  # a visitor left between two frames
        with contextlib.redirect_stdout(io.StringIO()):  # viser prints addresses of its own
            self._server = viser.ViserServer(HOST, config.port, verbose=False)
        self.port = self._server.get_port()
        if config.port not in (0, self.port):
            self.close()  # viser goes on to the next free one
            raise ConfigError(taken(config.port))
        # Viser can show a page through a server on the internet; this one stays on this machine.
        self._server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
        look(self._server.initial_camera)
        self._server.on_client_connect(self._enter)
        self._server.on_client_disconnect(self._leave)

    def close(self) -> None:
        """Send everybody home."""
        for visit in list(self.visits.values()):
            visit.leave()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _enter(self, client: viser.ClientHandle) -> None:
        with self._door:
            if len(self.visits) >= self._config.visitors:
                client.gui.add_markdown(
                    f"{self._config.visitors} visitors are here already, which is all that there is room for (`visitors=`). "
                    "Reload the page when one has left."
                )
                return
            visit = Visit(client, self._config, self._pilots, self._body, self._office)
            self.visits[client.client_id] = visit
            visit.start()

    def _leave(self, client: viser.ClientHandle) -> None:
        visit = self.visits.pop(client.client_id, None)
        if visit is not None:
            visit.leave()


@contextlib.contextmanager
def opened(config: PlayConfig, pilots: list[Candidate]) -> Iterator[Page]:
    """The page, served while the context lasts."""
    office = Office()
    try:
        page = Page(config, pilots, office)
        try:
            yield page
        finally:
            page.close()
    finally:
        office.close()


def check_port(port: int) -> None:
    """Raise ConfigError where `port` is taken or may not be listened to."""
    with socket.socket() as test:
        test.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            test.bind((HOST, port))
        except PermissionError:
            raise ConfigError(f"port = {port}: this user may not listen there; allowed are 1024 and above") from None
        except OSError:
            raise ConfigError(taken(port)) from None


def taken(port: int) -> str:
    """What to say where a port is taken."""
    return f"port = {port}: is in use on this machine; choose another, as port={port + 1}, or port=0 for any"
