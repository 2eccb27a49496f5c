"""A client of the viewer without a browser: it connects as the page does, and reads what every update has."""

import msgspec
import numpy as np
import viser
import zstandard
from websockets.sync.client import connect

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (0.0, 0.0, 1.0),
    "fov": 0.75,
    "near": 0.01,
    "far": 100.0,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


class Wire:
    """Hold what a page knows: properties of panel elements by label or kind, and of things in the scene by name."""

    def __init__(self, url, width=1600, height=1000):
        self.socket = connect(url.replace("http", "ws"), origin=url, subprotocols=[f"viser-v{viser.__version__}"])
        self.panel, self.scene, self.messages = {}, {}, []
        while not any(message["type"] == "ReplayDoneMessage" for message in self.messages):
            self.read()
        self.send(**CAMERA, image_width=width, image_height=height)

    def close(self):
        self.socket.close()

    def send(self, **message):
        self.socket.send(msgspec.msgpack.encode(message))

    def read(self, timeout=10):
        """Apply one update, as the page does before it draws a frame, and return whether there was one."""
        try:
            data = self.socket.recv(timeout)
        except TimeoutError:
            return False
        size = int.from_bytes(data[8:16], "little")
        content = msgspec.msgpack.decode(zstandard.decompress(data[16 : 16 + size]))
        at, buffers = 16 + size, []
        for length in content["binaryBufferLengths"]:
            at += -at % 8
            buffers.append(data[at : at + length])
            at += length
        self.messages = list(content["messages"])
        for message in self.messages:
            if message["type"].startswith("Gui") and "props" in message:
                self.panel[message["uuid"]] = {**message["props"], "value": message.get("value")}
            elif message["type"] == "GuiUpdateMessage":
                self.panel.setdefault(message["uuid"], {}).update(message["updates"])
            elif message["type"] == "SceneNodeUpdateMessage":
                self.scene.setdefault(message["name"], {}).update(message["updates"])
            elif "name" in message:
                node = self.scene.setdefault(message["name"], {})
                node.update(message.get("props") or {})
                node.update({key: message[key] for key in ("position", "wxyz", "visible", "owner") if key in message})
        self.buffers = buffers
        return True

    def element(self, **properties):
        """Return uuid and properties of the first panel element with these properties."""
        return next(
            (uuid, found)
            for uuid, found in self.panel.items()
            if all(found.get(key) == value for key, value in properties.items())
        )

    def readout(self):
        return next(found["content"] for found in self.panel.values() if "towline-readout" in str(found.get("content")))

    def set(self, value, **properties):
        """Set an element as a user does."""
        self.send(type="GuiUpdateMessage", uuid=self.element(**properties)[0], updates={"value": value})

    def array(self, placeholder):
        """Return an array of the last update."""
        data = self.buffers[placeholder["__binary_index"]]
        return np.frombuffer(data, dtype=placeholder["dtype"])
