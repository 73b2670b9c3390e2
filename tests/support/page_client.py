"""What the viewer's page does without drawing: takes all pictures, and says where its camera is."""

import threading

import msgspec
import viser
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

_CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (3.0, -3.0, 1.5),
    "fov": 1.3,
    "near": 0.01,
    "far": 1000.0,
    "image_height": 600,
    "image_width": 800,
    "look_at": (0.0, 0.0, 0.8),
    "up_direction": (0.0, 0.0, 1.0),
}


class PageClient:
    """In a `with` block, from as soon as there is a server until its end."""

    def __init__(self, port: int) -> None:
        self.pictures = 0
        self._port = port
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> "PageClient":
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._stop.set()
        self._thread.join(30.0)

    def _watch(self) -> None:
        while not self._stop.wait(0.05):
            try:
                with connect(
                    f"ws://127.0.0.1:{self._port}",
                    subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
                    max_size=None,
                ) as client:
                    client.send(msgspec.msgpack.encode(_CAMERA))
                    while not self._stop.is_set():
                        client.recv(timeout=5.0)
                        self.pictures += 1
            except (OSError, TimeoutError, WebSocketException):
                continue  # not yet there, or gone
