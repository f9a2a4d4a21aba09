"""One hash for all the code that a command runs: its module, every module of the package that it imports, their assets."""

import ast
import hashlib
from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import PipelineError

PACKAGE = "pipeline"
_BLOCKS = "body", "orelse", "finalbody", "handlers", "cases"  # where statements hold others
_DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


class Code:
    """The package below `source` (the folder that holds `pipeline/`), each file read and looked through at most once."""

    def __init__(self, source: str | Path) -> None:
        """Take the folder that holds the package."""
        self.source = Path(source)
        self._files: dict[str, Path] = {}
        self._trees: dict[Path, ast.Module] = {}
        self._texts: dict[str, bytes] = {}
        self._imported: dict[str, set[str]] = {}

    def hash(self, *entries: str) -> str:
        """Return a hash of what `python -m entry` runs for each of `entries`.

        It follows imports, also those inside functions, transitively. Comments, docstrings and layout are no part of it;
        what a page is made from, in the folder `assets` of a package, is.
        """
        digest = hashlib.sha256()
        modules = self.modules(*entries)
        for name in modules:
            digest.update(self._text(name))
        for path in sorted(path for name in modules for path in self._assets(name)):
            digest.update(f"{path.relative_to(self.source)}\n".encode() + path.read_bytes())
        return digest.hexdigest()[:16]

    def modules(self, *entries: str) -> list[str]:
        """Return the names of the modules that the hash covers."""
        waiting, seen = [self._entry(name) for name in entries], set()
        while waiting:
            name = waiting.pop()
            if name not in seen:
                seen.add(name)
                waiting += self._imports(name)
        return sorted(seen)

    def _entry(self, name: str) -> str:
        module = f"{name}.__main__" if (self.source / name.replace(".", "/")).is_dir() else name
        if not self._file(module).is_file():
            raise PipelineError(f"{self.source}: expected the module {module}, found none; restore it")
        return module

    def _file(self, name: str) -> Path:
        if name not in self._files:
            path = self.source / name.replace(".", "/")
            package = path / "__init__.py"
            self._files[name] = package if package.is_file() else path.with_suffix(".py")
        return self._files[name]

    def _assets(self, name: str) -> list[Path]:
        """Return the assets of a package; a module has none of its own."""
        file = self._file(name)
        return list(file.parent.glob("assets/*.*")) if file.name == "__init__.py" else []

    def _tree(self, name: str) -> ast.Module:
        file = self._file(name)
        if file not in self._trees:
            try:
                self._trees[file] = _without_docstrings(ast.parse(file.read_bytes()))
            except SyntaxError as error:
                raise PipelineError(
                    f"{file}, line {error.lineno}: expected Python, found: {error.msg}; correct it"
                ) from error
        return self._trees[file]

    def _text(self, name: str) -> bytes:
        if name not in self._texts:
            self._texts[name] = f"{name}\n{ast.dump(self._tree(name))}\n".encode()
        return self._texts[name]

    def _imports(self, name: str) -> set[str]:
        if name not in self._imported:
            self._imported[name] = self._named(name)
        return self._imported[name]

    def _named(self, name: str) -> set[str]:
        package = name if self._file(name).name == "__init__.py" else name.rpartition(".")[0]
        named = {name}
        for node in _statements(self._tree(name)):
            if isinstance(node, ast.Import):
                named |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                base = _absolute(node, package)
                named |= {base, *(f"{base}.{alias.name}" for alias in node.names)}
        return {module for dotted in named for module in _parents(dotted) if self._file(module).is_file()}


def _without_docstrings(tree: ast.Module) -> ast.Module:
    for node in _statements(tree):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:]
    return tree


def _statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the module and its statements, not the expressions within, which are ten times as many."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for block in _BLOCKS:
            waiting += getattr(node, block, ())


def _absolute(node: ast.ImportFrom, package: str) -> str:
    anchor = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
    return ".".join([*anchor, *([node.module] if node.module else [])])


def _parents(dotted: str) -> list[str]:
    """Return `dotted` and the packages around it, all of which an import runs; nothing for other distributions."""
    parts = dotted.split(".")
    return [".".join(parts[: i + 1]) for i in range(len(parts))] if parts[0] == PACKAGE else []
