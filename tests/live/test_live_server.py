"""The server of the live page: access, messages, pages that lose their connection, and the command."""

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, closing, contextmanager

import pytest
from click.testing import CliRunner
from live import asked, png, texture
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from simdtex import commands as cli
from simdtex.live import server as serving
from simdtex.live import session as sessions
from simdtex.live.server import TOKEN, Pages, is_own_name, listen, serve
from simdtex.machine import open_machine

SECRET = "a-token-of-the-tests"
OPEN = ExitStack()  # connections, which are closed when a test ends


@contextmanager
def running():
    """A server in this process; its port, and its pages."""
    pages = Pages(open_machine("reference"))
    with listen(pages, SECRET, "127.0.0.1", 0) as port:
        yield port, pages


@pytest.fixture
def port():
    with running() as (port, _):
        yield port


@pytest.fixture(autouse=True)
def closing_all():
    with OPEN:
        yield


def get(port, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    connection.request("GET", path, headers={"Host": f"127.0.0.1:{port}"} | headers)
    with closing(connection):
        answer = connection.getresponse()
        return answer, answer.read().decode()


class Client:
    """A page's end of a WebSocket."""

    def __init__(self, port, token=SECRET, session=None, host=None, origin=...):
        query = f"?session={session}" if session else ""
        host = host or f"127.0.0.1:{port}"
        origin = f"http://{host}" if origin is ... else origin
        tcp = socket.create_connection(("127.0.0.1", port))
        how = {"sock": tcp, "origin": origin, "max_size": None, "compression": None, "ping_interval": None}
        self.socket = OPEN.enter_context(connect(f"ws://{host}/{token}/socket{query}", **how))
        self.say(kind="hello")
        self.hello = self.wait("hello")[0]
        self.key = self.hello["session"]

    def say(self, *buffers, **message):
        self.socket.send(json.dumps(message | {"buffers": [len(one) for one in buffers]}))
        for one in buffers:
            self.socket.send(one)

    def wait(self, *kinds):
        while True:
            message = json.loads(self.socket.recv(timeout=120))
            buffers = [self.socket.recv(timeout=120) for _ in range(message["buffers"])]
            if message["kind"] == "frame":
                self.say(kind="shown")
            if message["kind"] in kinds:
                return message, buffers

    def ended(self):
        with pytest.raises(ConnectionClosed) as closed:
            self.wait("closed")
        return closed.value.rcvd


def soon(found, timeout=60):
    end = time.monotonic() + timeout
    while not found():
        assert time.monotonic() < end, "it is not so in time"
        time.sleep(0.01)


def test_the_page_is_served_to_whoever_knows_the_token(port):
    for name, kind in {"": "text/html", "live.js": "text/javascript", "live.css": "text/css"}.items():
        answer, text = get(port, f"/{SECRET}/{name}")
        assert (answer.status, answer.headers["Content-Type"].split(";")[0]) == (200, kind)
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        assert (answer.headers["Referrer-Policy"], answer.headers["Cache-Control"]) == ("no-referrer", "no-store")
        assert not re.findall(r"https?://[^\s\"'`]*", text), "nothing is loaded from elsewhere"
    for path in ("/", "/live.js", "/wrong/live.js", f"/{SECRET[:-1]}/", f"/{SECRET}x/", "/%C3%A4/"):
        answer, text = get(port, path)
        assert (answer.status, text) == (403, serving.REFUSED), path
    for name in ("x", "session.py", "..%2fsession.py"):
        assert get(port, f"/{SECRET}/{name}")[0].status == 404
    answer, _ = get(port, f"/{SECRET}")
    assert (answer.status, answer.headers["Location"]) == (308, f"/{SECRET}/")
    assert get(port, f"/{SECRET}/", Host="evil.example")[0].status == 400


def test_a_header_that_is_given_twice_is_refused(port, caplog):
    headers = {
        **{"Host": f"127.0.0.1:{port}", "Origin": f"http://127.0.0.1:{port}", "Upgrade": "websocket"},
        **{"Connection": "Upgrade", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA=="},
    }
    for name in ("Host", "Origin", "Sec-WebSocket-Key"):
        lines = [f"GET /{SECRET}/socket HTTP/1.1", *(": ".join(one) for one in headers.items())]
        with socket.create_connection(("127.0.0.1", port), timeout=60) as connection:
            connection.sendall("\r\n".join([*lines, f"{name}: {headers[name]}", "", ""]).encode())
            assert connection.recv(4096).startswith(b"HTTP/1.1 400 "), name
    assert not [record for record in caplog.records if record.exc_info]


OWN = ("127.0.0.1", "127.0.0.1:80", "localhost", "LOCALHOST:80", "[::1]", "[::1]:80")
OTHER = ("[::1].evil.example", "[::1]x:80", "[127.0.0.1]", "[evil.example]", "::1", "a@127.0.0.1", "localhost.", "")
OTHER += ("127.0.0.1:", "127.0.0.1:80:90", "127.0.0.1:x", "127.0.0.1]", "2130706433", "evil.example", "x/127.0.0.1")
OTHER += ("127.0.0.1.evil.example", "192.168.1.5", "[fe80::1]:80")


def test_a_server_has_its_own_names_alone():
    assert [host for host in OWN + OTHER if is_own_name(host, "127.0.0.1")] == list(OWN)
    numeric = ["192.168.1.5", "[fe80::1]:80"]
    assert [host for host in OWN + OTHER if is_own_name(host, "0.0.0.0")] == [*OWN, *numeric]
    assert is_own_name("Wall.local:80", "wall.local")


def test_a_socket_needs_the_host_the_token_and_the_origin(port):
    origins = [({"origin": origin}, 403) for origin in (None, "null", "https://127.0.0.1", "http://x")]
    for wrong, status in [({"host": "evil.example"}, 400), ({"token": "wrong"}, 403), *origins]:
        with pytest.raises(InvalidStatus) as refused:
            Client(port, **wrong)
        assert refused.value.response.status_code == status, wrong


def test_two_pages_have_nothing_in_common_and_one_that_was_lost_comes_back(port):
    first, second = Client(port), Client(port)
    assert first.hello["fresh"] and first.hello["device"] == "reference (NumPy)"
    for page, seed in ((first, 1), (second, 2)):
        page.say(png(texture(seed=seed)), kind="open", name=f"{seed}.png")
        page.say(**asked(seed=seed, method="pyramid", options={"iterations": 1}))
    assert [page.wait("result")[0]["settings"]["seed"] for page in (first, second)] == [1, 2]
    first.say(kind="download", result=1, name="texture.png")
    message, (data,) = first.wait("file")
    assert message["name"] == "texture.png" and data.startswith(b"\x89PNG")
    other = Client(port, session=first.key)  # as a tab that was duplicated asks: the first is still open
    assert len({first.key, second.key, other.key}) == 3
    first.socket.close()
    for _ in range(100):
        again = Client(port, session=first.key)
        if again.key == first.key:  # the server has heard of it
            break
        again.socket.close()
        time.sleep(0.02)
    assert again.hello["fresh"] is False and again.wait("result")[0]["result"] == 1


def test_pages_are_few_and_those_that_were_lost_give_way(monkeypatch):
    monkeypatch.setattr(serving, "MAX_PAGES", 2)
    with running() as (port, pages):
        first, second = Client(port), Client(port)
        with pytest.raises(ConnectionClosed) as closed:
            Client(port)
        assert closed.value.rcvd.code == serving.TOO_MANY
        first.socket.close()
        soon(lambda: pages._lost)
        Client(port)
        assert set(pages._sessions) > {second.key} and first.key not in pages._sessions
        second.socket.close()
        soon(lambda: pages._lost)
        monkeypatch.setattr(serving, "MAX_PAGES", 9)
        pages.join(None, lambda *_: None)
        assert second.key in pages._sessions
        monkeypatch.setattr(serving, "KEPT", -1.0)
        pages.join(None, lambda *_: None)
        assert second.key not in pages._sessions, "it has been lost for too long"


def test_what_is_no_message_ends_the_connection(port):
    for text in ("", "3", '{"buffers": 3}', "[" * 10000, b"\xff"):
        page = Client(port)
        page.socket.send(text)
        assert page.ended().code == serving.BAD_MESSAGE, text
    for sizes in ([0], ["x"], [2**27 + 1], [6]):
        page = Client(port)
        page.socket.send(json.dumps({"kind": "open", "name": "a.png", "buffers": sizes}))
        with pytest.raises(ConnectionClosed) as closed:
            for _ in range(2):
                page.socket.send(bytes(4))
            while True:
                page.wait("closed")
        assert closed.value.rcvd.code == serving.BAD_MESSAGE, sizes


@pytest.mark.slow
@pytest.mark.parametrize(("number", "token"), [(signal.SIGINT, ""), (signal.SIGTERM, SECRET)])
def test_the_command_prints_an_address_serves_it_and_ends(number, token, tmp_path):
    (tmp_path / "wall.png").write_bytes(png(texture()))
    process = subprocess.Popen(
        [sys.executable, "-m", "simdtex", "live", "--no-browser", "--device", "reference", str(tmp_path / "wall.png")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {TOKEN: token},
    )
    line = process.stdout.readline()
    address = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]+)/  \(on reference \(NumPy\); Ctrl-C ends it\)\n", line)
    assert address[2] == token or (len(address[2]) == 32 and not token)
    assert get(int(address[1]), f"/{address[2]}/")[0].status == 200
    page = Client(int(address[1]), address[2])
    assert page.wait("picture")[0]["name"] == "wall.png"
    page.say(**asked(width=400, height=400))
    page.wait("begun")
    process.send_signal(number)
    output, errors = process.communicate(timeout=60)
    assert (process.returncode, output, errors) == (0, "ended\n", "")


def test_what_cannot_be_served_is_said(tmp_path, monkeypatch):
    words = ["live", "--no-browser", "--device", "reference"]
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        refused = CliRunner().invoke(cli.main, [*words, "--port", str(port)])
    assert refused.exit_code == 2 and f"cannot listen to 127.0.0.1 port {port}" in refused.output
    refused = CliRunner().invoke(cli.main, [*words, str(tmp_path / "none.png")])
    assert refused.exit_code == 2 and "none.png does not exist" in refused.output
    monkeypatch.setenv(TOKEN, "short")
    with pytest.raises(ValueError, match="must be 16 or more letters"):
        serve(None, "reference", "127.0.0.1", 0, lambda *_: None)
    monkeypatch.setitem(sys.modules, "websockets", None)
    refused = CliRunner().invoke(cli.main, ["live"])
    assert refused.exit_code == 2 and "pip install 'simdtex[live]'" in refused.output


@pytest.mark.slow
@pytest.mark.parametrize("returns", [False, True])
def test_the_run_of_a_page_that_is_gone_ends_unless_it_comes_back_in_time(monkeypatch, returns):
    monkeypatch.setattr(serving, "RUN_KEPT", 0.5 if returns else 0.0)
    with running() as (port, pages):
        page = Client(port)
        session = pages._sessions[page.key]
        page.say(png(texture()), kind="open", name="a.png")
        page.say(**asked(width=400, height=400))
        page.wait("begun")
        page.socket.close()
        if returns:
            soon(lambda: page.key in pages._lost)
            shown = Client(port, session=page.key).wait("picture")[0]
            assert not shown["new"] and shown["settings"]["width"] == 400
            time.sleep(1)
            assert session._begun, "the run goes on"
            return
        soon(lambda: session._wanted is None and session._begun is None)
        assert page.key in pages._sessions, "the session is kept"
        monkeypatch.setattr(serving, "KEPT", 0.0)
        soon(lambda: not pages._sessions)
        session._thread.join(60)
        assert not session._thread.is_alive()


def test_a_file_that_stops_half_way_ends_the_connection_and_others_go_on(monkeypatch):
    monkeypatch.setattr(serving, "PIECE_WAIT", 0.2)
    with running() as (port, _):
        first, second = Client(port), Client(port)
        first.socket.send(json.dumps({"kind": "open", "name": "a.png", "buffers": [400]}))
        first.socket.send(bytes(100))
        second.say(kind="example", name="brick")
        assert first.ended().reason == "the file has not come in time"
        assert second.wait("picture")[0]["name"] == "brick.png"


class Deadly:
    """A name that ends the process which receives it."""

    def __reduce__(self):
        return os._exit, (3,)


def test_a_file_is_read_in_a_process_of_its_own(monkeypatch):
    with pytest.raises(ValueError, match=r"a\.png is not an image"):
        sessions.read_apart("a.png", b"hello")
    monkeypatch.setattr(sessions, "READ_WAIT", 0.0)
    with pytest.raises(ValueError, match="cannot be read within 0 s"):
        sessions.read_apart("a.png", b"hello")


@pytest.mark.slow
def test_a_file_that_crashes_its_reader_is_told():
    with pytest.raises(ValueError, match="ends the process that reads it: save it again as PNG"):
        sessions.read_apart(Deadly(), b"")


def test_a_server_ends_while_a_file_is_read_and_a_page_does_not_read(monkeypatch):
    entered, never = threading.Event(), threading.Event()
    monkeypatch.setattr(sessions, "read_apart", lambda *_: (entered.set(), never.wait()))
    monkeypatch.setattr(serving, "ENDING", 0.2)
    with running() as (port, pages):
        page, deaf = Client(port), Client(port)
        page.say(png(texture()), kind="open", name="a.png")
        entered.wait()
        send, large = pages._sessions[deaf.key].send, bytes(2**27)
        sending = threading.Thread(target=send, args=({"kind": "file"}, [large]), daemon=True)
        sending.start()
    sending.join()
    never.set()


def test_few_small_messages_wait(monkeypatch):
    monkeypatch.setattr(sessions, "MAX_QUEUE", 4)
    with running() as (port, pages):
        page = Client(port)
        session = pages._sessions[page.key]
        holding = threading.Event()
        monkeypatch.setattr(session, "_on_pause", lambda *_: holding.wait(5))
        for kind in ["pause", *["resume"] * 40]:
            page.say(kind=kind)
        soon(lambda: session._messages.qsize() >= 4)
        time.sleep(0.2)
        assert session._messages.qsize() == 4
        holding.set()
