"""A PostgreSQL of the project's own, from the distribution's packages: one folder, a local socket, no password, no service."""

import os
import pwd
import shutil
import subprocess
import tempfile
from pathlib import Path

from pipeline.errors import PipelineError

USER = "mlflow"
DEBIAN = Path("/usr/lib/postgresql")  # where Debian and Ubuntu keep the programs, out of PATH


def programs() -> Path:
    """Return the folder with `initdb` and `pg_ctl`: of PATH, or the newest of Debian's."""
    found = shutil.which("initdb")
    if found:
        return Path(found).resolve().parent
    versions = sorted(DEBIAN.glob("*/bin/initdb"), key=lambda path: float(path.parts[-3]))
    if versions:
        return versions[-1].parent
    raise PipelineError(
        f"PostgreSQL: expected initdb in PATH or in {DEBIAN}, found none; run: sudo apt-get install postgresql"
    )


class Cluster:
    """A database that runs while it is used as a context; what was written stays in the folder."""

    def __init__(self, folder: str | Path) -> None:
        """Take the folder of the database, made on first use."""
        self.data = Path(folder).resolve() / "postgres"
        self.log = self.data.with_suffix(".log")
        self._programs = programs()
        # PostgreSQL refuses to run as root; its packages bring a user for it.
        self._as = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []

    def __enter__(self) -> str:
        """Start the database; return its address for SQLAlchemy."""
        self._make()
        # Only who owns this folder can connect; a socket's path may have 107 characters at most.
        self._socket = tempfile.mkdtemp(prefix="mlflow-")
        self._give(Path(self._socket))
        options = f"-c listen_addresses='' -c unix_socket_directories='{self._socket}'"
        try:
            self._call("pg_ctl", "start", "--wait", "--log", str(self.log), "--options", options)
        except BaseException:
            shutil.rmtree(self._socket, ignore_errors=True)
            raise
        return f"postgresql+psycopg2://{USER}@/postgres?host={self._socket}"

    def __exit__(self, *_: object) -> None:
        """Stop the database, with all that was written on disk."""
        try:
            self._call("pg_ctl", "stop", "--wait", "--mode", "fast")
        finally:
            shutil.rmtree(self._socket, ignore_errors=True)

    def _make(self) -> None:
        if (self.data / "PG_VERSION").is_file():
            return
        try:
            self.data.mkdir(parents=True, exist_ok=True)
            self.log.touch()
        except OSError as error:
            raise PipelineError(
                f"{self.data}: expected a folder that can be written, found: {error.strerror}; "
                "give another with --folder"
            ) from error
        self._give(self.data)
        self._give(self.log)
        self._call("initdb", "--auth", "trust", "--encoding", "UTF8", "--locale", "C", "--username", USER)

    def _give(self, path: Path) -> None:
        if self._as:
            try:
                owner = pwd.getpwnam("postgres")
            except KeyError as error:
                raise PipelineError(
                    "PostgreSQL: expected the user 'postgres', as root cannot run it, found none; "
                    "call this as another user"
                ) from error
            os.chown(path, owner.pw_uid, owner.pw_gid)

    def _call(self, program: str, *words: str) -> None:
        command = [*self._as, str(self._programs / program), "--pgdata", str(self.data), *words]
        # Its output goes to a file: the server keeps it open, and reading a pipe of it would never end.
        with tempfile.TemporaryFile("w+") as said:
            done = subprocess.run(command, cwd="/", stdin=subprocess.DEVNULL, stdout=said, stderr=said)
            said.seek(0)
            lines = said.read().split("\n")
        if done.returncode:
            reason = " ".join(line.strip() for line in lines if line.strip())[-300:]
            raise PipelineError(
                f"{self.data}: expected that {program} succeeds, found: {reason}; look in {self.log}, "
                "or give another folder with --folder (as root: one that the user 'postgres' can reach)"
            )
