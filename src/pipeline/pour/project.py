"""The project in a folder: which objects it knows and where the workflow keeps what it made of them."""

from pathlib import Path
from typing import Any

from pipeline.errors import PipelineError
from pipeline.workflow.configuration import nearest
from pipeline.workflow.objects import sources


class Project:
    """A project's folder; nothing is read before it is asked for."""

    def __init__(self, folder: str | Path) -> None:
        """Take the folder that holds config/ and data/."""
        self.folder = Path(folder)
        self.raw = self.folder / "data/raw"
        self.processed = self.folder / "data/processed"

    def config(self) -> dict[str, Any]:
        """Return what config/config.yaml says."""
        import yaml

        path = self.folder / "config/config.yaml"
        try:
            return yaml.safe_load(path.read_text())
        except (OSError, yaml.YAMLError) as error:
            raise PipelineError(
                f"{path}: expected the project's configuration, but it cannot be read: {error}; "
                "call this in the project's folder or name it with --project"
            ) from error

    def source(self) -> str:
        """Return the name of the annotated object; of several, the first, which classifiers are learnt with."""
        return sources(self.config())[0]

    def objects(self) -> list[str]:
        """Return the names of all objects that were scanned or dropped, in alphabetical order."""
        folders = [*self._names(self.raw), *self._names(self.processed / "fuse")]
        return sorted(
            {*folders, *self.config()["scan"]["objects"]} - set(self.config()["objects"]["exclude"])
        )

    def check(self, name: str) -> str:
        """Return `name` if it is an object's; otherwise the error proposes the most similar one."""
        known = self.objects()
        if name not in known:
            raise PipelineError(
                f"{name}: expected an object of {self.raw} ({' '.join(known) or 'none yet'}), found none of this name"
                f"{nearest(name, known)}; correct it, or drop its scan in {self.raw / name}"
            )
        return name

    def made(self, path: str | Path) -> Path:
        """Return a file below data/processed; if the workflow has not made it yet the error says how it is made."""
        file = self.processed / path
        if not file.is_file():
            raise PipelineError(
                f"{file}: expected a file that the workflow makes, found none; "
                f"run: snakemake -c2 {file.relative_to(self.folder)}"
            )
        return file

    @staticmethod
    def _names(folder: Path) -> list[str]:
        inside = folder.iterdir() if folder.is_dir() else ()
        return [path.name for path in inside if path.is_dir() and not path.name.startswith(".")]
