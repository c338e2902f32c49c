"""A headless browser spoken to by the DevTools protocol over a pipe, without further packages."""

import base64
import contextlib
import fcntl
import itertools
import json
import os
import select
import shutil
import signal
import tempfile
import time

#: What a browser without a graphics card, or Plotly's way to read colours, is warned of.
HARMLESS = ("GL Driver Message", "software WebGL", "willReadFrequently")
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
#: Seconds after which a browser that says nothing, or a page on which nothing comes, is given up.
LONGEST = 120


def find_browser():
    """The path of a browser, or None."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


class Browser:
    """One page of a headless browser; errors and warnings of its console are collected."""

    def __init__(self, path, width=1280, height=900):
        to_browser, self._write = os.pipe()
        self._read, from_browser = os.pipe()
        # out of the way of 3 and 4, which the protocol wants
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 64) for end in (to_browser, from_browser)]
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        command = [
            *(path, "--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu", "--no-first-run"),
            *("--disable-dev-shm-usage", "--disable-extensions", "--disable-background-networking", "--disable-sync"),
            *("--disable-component-update", "--disable-renderer-backgrounding", "--force-device-scale-factor=1"),
            *(f"--user-data-dir={self._profile.name}", f"--window-size={width},{height}", "about:blank"),
        ]

        files = [(os.POSIX_SPAWN_DUP2, ends[0], 3), (os.POSIX_SPAWN_DUP2, ends[1], 4)]
        files += [(os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_WRONLY, 0) for stream in (1, 2)]
        self._process = os.posix_spawn(path, command, os.environ, file_actions=files)
        for end in (to_browser, from_browser, *ends):
            os.close(end)
        self._numbers, self._pending, self._events = itertools.count(1), b"", []
        self._session = None
        targets = self.call("Target.getTargets")["targetInfos"]
        target = next(item["targetId"] for item in targets if item["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network", "Inspector"):
            self.call(f"{domain}.enable")
        self.size(width, height)

    def call(self, method, **parameters):
        """The result of a call."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") == number:
                assert "error" not in answer, answer
                return answer["result"]
            assert answer.get("method") != "Inspector.targetCrashed", "the page has crashed: it will never answer"
            self._events.append(answer)

    def _message(self):
        while b"\0" not in self._pending:
            assert select.select([self._read], [], [], LONGEST)[0], f"the browser has said nothing for {LONGEST} s"
            part = os.read(self._read, 1 << 20)
            assert part, "the browser has ended"
            self._pending += part
        message, _, self._pending = self._pending.partition(b"\0")
        return json.loads(message)

    def size(self, width, height):
        """Set the size of the window."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )

    def show(self, path, width=1280, height=900):
        """Open a file in a window of that size."""
        self.size(width, height)
        self.open(path)

    def choose(self, name, value):
        """Choose a value of a control of the page."""
        self.evaluate(f"byId('{name}').value = '{value}'; byId('{name}').dispatchEvent(new Event('change'))")
        self.settle()

    def open_details(self):
        """Unfold what is folded on all cards."""
        self.evaluate("document.querySelectorAll('#cards details').forEach((d) => { d.open = true; })")
        self.settle()

    def open(self, path):
        """Open a file, and wait until its script has started."""
        self._events.clear()
        self.call("Page.navigate", url=path.resolve().as_uri())
        failed = "document.getElementById('failed') && !document.getElementById('failed').hidden ? 'failed' : ''"
        state = self.wait_for(f"document.body && document.body.dataset.ready === 'yes' ? 'ready' : {failed}")
        assert state == "ready", "the page says that it failed"
        self.settle()

    def settle(self):
        """Wait until what was begun has been drawn; a page that is not shown draws nothing."""
        drawn = "requestAnimationFrame(() => requestAnimationFrame(() => done(1)))"
        self.evaluate(f"new Promise((done) => {{ {drawn}; setTimeout(() => done(0), 2000); }})")

    def wait_for(self, script, before_a_look=None):
        """The value of an expression as soon as it holds; what makes it hold may be done again before each look."""
        last = time.monotonic() + LONGEST
        while time.monotonic() < last:
            if before_a_look is not None:
                before_a_look()
            if value := self.evaluate(script):
                return value
            time.sleep(0.02)
        raise AssertionError(f"after {LONGEST} s this still does not hold: {script}")

    def evaluate(self, script):
        """The value of an expression; promises are awaited."""
        result = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def mouse(self, kind, x, y, **options):
        """Send a mouse event: mouseMoved, mousePressed or mouseReleased."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **options)

    def click(self, x, y):
        """Move there and click."""
        self.mouse("mouseMoved", x, y)
        self.settle()
        self.mouse("mousePressed", x, y, button="left", clickCount=1)
        self.mouse("mouseReleased", x, y, button="left", clickCount=1)
        self.settle()

    def complaints(self):
        """What the console was told: errors and warnings, exceptions, and requests that left the page."""
        found = []
        for event in self._events:
            parameters = event.get("params", {})
            if event.get("method") == "Runtime.exceptionThrown":
                found.append(parameters["exceptionDetails"].get("text"))
            if event.get("method") == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning"):
                found.append(str([item.get("value") for item in parameters["args"]]))
            if event.get("method") == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
                found.append(parameters["entry"]["text"])
            if event.get("method") == "Network.requestWillBeSent":
                url = parameters["request"]["url"]
                if not url.startswith(("file:", "data:", "blob:", "about:")):
                    found.append(f"a request to {url}")
        return [text for text in found if not any(part in str(text) for part in HARMLESS)]

    def screenshot(self, path, *, whole=True):
        """Write a picture of the page."""
        drawn = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(drawn["data"]))

    def close(self):
        """End the browser."""
        self._session = None
        try:
            self.call("Browser.close")
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGKILL)
            os.waitpid(self._process, 0)
            os.close(self._write)
            os.close(self._read)
            self._profile.cleanup()
