"""Serve one page to the browser of this machine until it is closed or Ctrl-C."""

import secrets
import threading
import webbrowser
from collections.abc import Callable, Mapping
from typing import Any

from pipeline.command import say
from pipeline.errors import PipelineError

HOST = "127.0.0.1"
Answer = Callable[[Any], Any]


def serve(
    page: Callable[[str], str],
    answers: Mapping[str, Answer],
    *,
    port: int,
    opened: bool,
    closes: bool = False,
) -> None:
    """Serve `page(token)` on this machine alone until Ctrl-C or, where it `closes`, until the page posts to /close.

    `answers`: path → what answers JSON posted there, in the server's thread; a `PipelineError` is told to the page. Only the
    page itself can post, as it alone knows the token. `opened`: open it in the user's browser, too.
    """
    import logging

    from werkzeug.serving import make_server

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    closing = threading.Event()
    close = {"/close": lambda _: closing.set()} if closes else {}
    application = _application(page, {**answers, **close})
    try:
        server = make_server(HOST, port, application, threaded=True)
    except (OSError, SystemExit) as error:
        raise PipelineError(
            f"--port {port}: expected a free port, found one in use; choose another or 0"
        ) from error
    url = f"http://{HOST}:{server.server_port}/"
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    say(f"{url} is open until {'it is closed there or by ' if closes else ''}Ctrl-C here")
    if opened:
        webbrowser.open(url)
    try:
        while not closing.wait(0.2):
            pass
    except KeyboardInterrupt:
        say("closed")
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def _application(page: Callable[[str], str], answers: Mapping[str, Answer]) -> Any:
    import flask

    application, token = flask.Flask("pour", static_folder=None), secrets.token_urlsafe()
    html = page(token)

    @application.before_request
    def _check() -> None:
        # Another page may reach this port by a name of its own, but not by this one, and does not know the token.
        if flask.request.host.rpartition(":")[0] not in (HOST, "localhost"):
            flask.abort(403)
        if flask.request.method == "POST" and flask.request.headers.get("X-Token") != token:
            flask.abort(403)

    @application.get("/")
    def _page() -> Any:
        return flask.Response(html, headers={"Cache-Control": "no-store"}, mimetype="text/html")

    @application.post("/<path:path>")
    def _answer(path: str) -> Any:
        if f"/{path}" not in answers:
            flask.abort(404)
        try:
            return {"answer": answers[f"/{path}"](flask.request.get_json())}
        except PipelineError as error:
            return {"error": str(error)}, 400

    return application
