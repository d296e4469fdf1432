"""The address of the page, checked before anything that is slow to import."""

import socket

from posture.config.errors import ConfigError

HOST = "127.0.0.1"


def check_port(port: int) -> None:
    """Raise ConfigError if `port` is in use or needs more rights."""
    with socket.socket() as test:
        test.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            test.bind((HOST, port))
        except PermissionError:
            raise ConfigError(f"port = {port}: this user may not listen there; allowed are 1024 and above") from None
        except OSError:
            raise port_in_use(port) from None


def port_in_use(port: int) -> ConfigError:
    """The error to raise."""
    return ConfigError(f"port = {port}: in use on this machine; choose another, or port=0 for any free one")
