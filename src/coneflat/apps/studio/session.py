"""A session: a mesh, what is chosen for it, and the layout that follows; there is no web in it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from ... import ConeflatError
from ...base import shown
from ...errors import MeshFileError, StudioError
from ...options import as_whole
from .choices import Choices, replay
from .known import Known
from .messages import misplaced
from .outputs import EXPORTS, MOST_QUADS, QUADS, curve_options
from .project import Project, file_within, opened
from .steps import STEPS, History
from .worker import Head, Worker

PATIENCE = 600.0  # seconds that saving waits for the flattening before it


class _Layout(NamedTuple):
    """A layout: what is shown, the cones of it, the seconds that it took, and what is to be known of it."""

    shown: tuple[Head, bytes] | None = None
    found: Sequence[int] = ()
    seconds: Mapping[str, float] = MappingProxyType({})
    warnings: Sequence[str] = ()


class Session:
    """What the user works on. All of it may be called from any thread.

    Attributes:
        folder: where projects are, and whatever the page names.
        version: counts what has happened; who has seen a version need not look again.
        layout: the number of the layout that was shown last; no other one gets it, whatever mesh is opened.
        is_early: whether that is the first one of a change, and another will follow.
    """

    def __init__(self, folder: Path, color: str | None = None, most_triangles: int | None = None) -> None:
        """Args:
        folder: of projects.
        color: what numbers are shown as colours, as of `own_quantity`.
        most_triangles: of larger meshes fewer are shown; None for as many as the viewer's page shows.
        """
        self._look = {"color": color, "most": most_triangles}
        self.folder = folder.resolve()
        self.version = 0
        self.layout = 0
        self.is_early = False
        self.project_file: Path | None = None
        self._mesh: Path | None = None
        self._sha256 = ""
        self._history = History(Choices())
        self._opened = 0  # meshes and projects until now
        # Counts changes of what is chosen, and so numbers it; 0 is nothing that anybody knows.
        self._chosen = 1
        self._job = 0
        self._busy: dict[str, Any] | None = None
        self._trouble: dict[str, Any] | None = None
        self._now = _Layout()
        self._of_choices: tuple[int, tuple[str, ...], dict[str, str]] = 0, (), {}
        self._known = Known()
        self._last: _Layout | None = None  # of an earlier change, while one on the way is shown
        self._questions = 0
        self._answers: dict[int, tuple[Head, bytes]] = {}
        self._curves: dict[tuple[str, str], dict[str, Any]] = {}
        self._changed = threading.Condition(threading.RLock())
        self._listeners: list[Callable[[], None]] = []
        self._worker = Worker(self._hear, self._mourn)

    # Meshes and projects.

    def open(self, path: Path) -> None:
        """Work on a mesh, with what was chosen for it before in this folder; or on a project.

        Raises:
            MeshFileError: the mesh cannot be read.
            ProjectError: the project cannot, or its mesh is another.
        """
        self._begin(*opened(path, self.folder))

    def open_named(self, name: str) -> None:
        """Work on a mesh or a project in the session's folder.

        Raises:
            StudioError: it is not a file of the folder.
            MeshFileError, ProjectError: as of `open`.
        """
        self._begin(*opened(file_within(name, self.folder), self.folder, only_within=True))

    def _begin(self, project: Project, file: Path) -> None:
        with self._changed:
            self._mesh, self._sha256, self.project_file = project.mesh.resolve(), project.sha256, file
            self._history = History(project.choices)
            self._opened += 1
            self._chosen += 1
            self._now = _Layout(seconds=self._now.seconds)
            self.is_early, self._last = False, None
            self._flatten()

    # What the user does.

    def act(self, action: Mapping[str, Any]) -> None:
        """Do what the user asks for.

        Args:
            action: what to `do`: "set" an option (`name`, `value`), take the cones by "hand", "add", "move", "remove",
                "angle" or "lock" a cone (`vertex`; `to`, `degrees`, `locked`), "cut" or "keep" a `path`, "erase" an
                `edge`, "paint" a `layer` (`where`; `weight`), take or leave a "corner" (`vertex`), show lengths in
                "units" (`of_file`, `shown`), "undo", "redo", or "again". Steps of one `stroke` are undone together.

        Raises:
            StudioError: it makes no sense, or cannot be done.
            OptionError: options make no sense, or do not go together.
        """
        with self._changed:
            self._require_mesh()
            kind, history = action.get("do"), self._history
            if kind == "again":
                self._flatten()
            elif kind in ("undo", "redo"):
                before = history.now
                if history.undo() if kind == "undo" else history.redo():
                    self._follow(before)
            else:
                try:
                    chosen = STEPS[str(kind)](history.now, action, self._now.found)
                except (KeyError, TypeError) as error:
                    raise StudioError(f"the studio does nothing by {shown(dict(action))}") from error
                self._take(chosen, action.get("stroke"))

    def choose(self, plain: Mapping[str, Any]) -> None:
        """Choose all anew, as `Choices.as_plain` has it.

        Raises:
            StudioError: it makes no sense, or there is no mesh.
            OptionError: options make no sense, or do not go together.
        """
        with self._changed:
            self._require_mesh()
            try:
                chosen = Choices.from_plain({**Choices().as_plain(), **plain})
            except ConeflatError:
                raise
            except (KeyError, TypeError, ValueError, AttributeError) as error:
                raise StudioError(f"these are not choices: {shown(dict(plain))}") from error
            self._take(chosen, None)

    def _require_mesh(self) -> None:
        if self._mesh is None:
            raise StudioError("there is no mesh yet: drop one on the page, or run coneflat studio MESH")

    def _take(self, chosen: Choices, stroke: object) -> None:
        """Take a step, if it is one."""
        chosen.keywords()
        before = self._history.now
        if self._history.change(chosen, stroke):
            self._follow(before)

    def _follow(self, before: Choices) -> None:
        """Do what follows from a step: a layout, or no more than that what is chosen is kept and told."""
        self._chosen += 1
        if not self._history.now.flattens_like(before):
            return self._flatten()
        trouble = self._trouble
        self._save()
        self._trouble = self._trouble or trouble
        return self._tell()

    def _flatten(self) -> None:
        assert self._mesh is not None
        self._save()
        self._job += 1
        self._busy = {"stage": "", "fraction": 0.0}
        self._tell()
        self._worker.send({"do": "flatten", "job": self._job, **self._look, **self._of_mesh()})

    def _save(self) -> None:
        """Keep what is chosen, so that nothing is lost whatever happens next."""
        assert self._mesh is not None
        assert self.project_file is not None
        self._trouble = None
        try:
            Project(self._mesh, self._sha256, self._history.now).save(self.project_file)
        except MeshFileError as error:
            self._trouble = {"text": f"the project is not saved: {error}", "repair": False}

    # What comes of it.

    @property
    def stages(self) -> dict[str, float]:
        """The seconds that each stage of the layout that is shown took."""
        return dict(self._now.seconds)

    def state(self, known: int = 0) -> dict[str, Any]:
        """Return all that there is to know, as plain values.

        known: the number, `chosen`, of choices that need not be told again: paint may be large, and news come often.
        """
        with self._changed:
            undo, redo = self._history.depth
            warnings, texts = self._told_of_choices()
            return {
                "version": self.version,
                "opened": self._opened,
                "mesh": None if self._mesh is None else self._mesh.name,
                "project": self._project_name,
                "chosen": self._chosen,
                "undo": undo,
                "redo": redo,
                "busy": self._busy,
                "trouble": self._trouble,
                "layout": 0 if self._now.shown is None else self.layout,
                "early": self.is_early,
                "found": list(self._now.found),
                "seconds": sum(self._now.seconds.values()),
                "warnings": [*warnings, *self._now.warnings],
                **({} if known == self._chosen else {"choices": self._history.now.as_plain(), **texts}),
            }

    @property
    def _project_name(self) -> str:
        return "" if self.project_file is None else self.project_file.name

    def _told_of_choices(self) -> tuple[tuple[str, ...], dict[str, str]]:
        """Return warnings of what is chosen, and what `replay` does; made once for each change."""
        if self._of_choices[0] != self._chosen:
            chosen, texts = self._history.now, {"command": "", "python": ""}
            if self._mesh is not None:
                texts = replay(self._mesh.name, self._project_name, chosen)
            self._of_choices = self._chosen, misplaced(chosen), texts
        return self._of_choices[1:]

    def picture(self, known: int = 0) -> tuple[Head, bytes] | None:
        """Return the layout that is shown: numbers and texts, and arrays; None where there is none yet.

        known: the number of a picture whose arrays need not be told again.
        """
        with self._changed:
            return None if self._now.shown is None else self._known.without(known, self._now.shown)

    def export(self, ending: str) -> bytes:
        """Return the result of what is chosen, as a file.

        Raises:
            StudioError: there is none, or no such format.
        """
        if ending not in EXPORTS:
            raise StudioError(
                f"{shown(ending)} is not a format that results are saved as: {', '.join(EXPORTS)}"
            )
        return self._asked({"do": "export", "ending": ending})[1]

    def quads(self, ending: str, count: object) -> bytes:
        """Return quads of the mesh, about so many, as a file; a change ends the work on them.

        Raises:
            StudioError: there is no mesh, no such format, or something was changed.
            OptionError: the number makes no sense.
        """
        if ending not in QUADS:
            raise StudioError(f"{shown(ending)} is not a format that quads are saved as: {', '.join(QUADS)}")
        number = as_whole("the number of quads", count)
        if not 1 <= number <= MOST_QUADS:
            raise StudioError(f"the number of quads must be from 1 to {MOST_QUADS:,}, not {number:,}")
        return self._asked({"do": "quads", "ending": ending, "count": number})[1]

    def curve(self) -> dict[str, Any]:
        """Return the distortion for each number of cones, as `curve_of` does; a change ends the work on it.

        Raises:
            StudioError: there is no mesh, or something was changed.
        """
        with self._changed:
            key = self._sha256, sha256(repr(curve_options(self._history.now)).encode()).hexdigest()
            if key not in self._curves:
                self._curves[key] = self._asked({"do": "curve"})[0]
            return self._curves[key]

    def _asked(self, job: Head) -> tuple[Head, bytes]:
        """Return what the worker makes of a job beside the flattenings."""
        with self._changed:
            self._require_mesh()
            if not self._worker.is_alive:  # What it had is gone.
                self._flatten()
            self._questions -= 1  # No flattening has such a number.
            number = self._questions
            self._answers[number] = ({}, b"")
            # What takes long is given up for a later flattening.
            stops = {} if job["do"] == "export" else {"after": self._job}
            self._worker.send({**job, **stops, **self._of_mesh(), "job": number})
            self._changed.wait_for(lambda: self._answers[number][0], PATIENCE)
            head, body = self._answers[number]
            del self._answers[number]
        if "given_up" in head:
            raise StudioError("something was changed meanwhile: ask again")
        if "done" not in head:
            raise StudioError(head.get("error", "this took too long"))
        return head["done"], body

    def _of_mesh(self) -> Head:
        return {"mesh": str(self._mesh), "sha256": self._sha256, "choices": self._history.now.as_plain()}

    def listen(self, listener: Callable[[], None]) -> None:
        """Call a function, from any thread, whenever something has happened."""
        self._listeners.append(listener)

    def wait_until_idle(self, seconds: float = PATIENCE) -> bool:
        """Return whether what is chosen was flattened, or has failed, within some time."""
        with self._changed:
            return self._changed.wait_for(lambda: self._busy is None, seconds)

    def close(self) -> None:
        """End the process that flattens, and every wait for news."""
        self._worker.end()
        with self._changed:
            self._tell()

    @property
    def worker_process(self) -> int | None:
        """The number of the process that flattens."""
        return self._worker.process_id

    # What the worker tells.

    def _hear(self, head: Head, body: bytes) -> None:
        with self._changed:
            if head["job"] in self._answers and "stage" not in head:
                self._answers[head["job"]] = (head, body)
                self._changed.notify_all()
                return
            if head["job"] != self._job:
                return
            if "stage" in head:
                self._busy = {"stage": head["stage"], "fraction": head["fraction"]}
            elif "early" in head:
                self._last = self._last or self._now
                self._show(head["early"], body)
                self.is_early = True
            elif "error" in head:
                self._go_back()
                mends = head["repair"] and not self._history.now.options.get("repair")
                self._trouble = {"text": head["error"], "repair": mends}
            elif "done" in head:
                self._busy = None
                self._show(head["done"], body)
                if "missing" in head["done"] and self._trouble is None:
                    self._trouble = {"text": head["done"]["missing"], "repair": False}
                self.is_early, self._last = False, None
            self._tell()

    def _show(self, told: Head, body: bytes) -> None:
        self.layout += 1
        picture = self._known.numbered((told["head"], body))
        self._now = _Layout(picture, told["found"], told["seconds"], told.get("warnings", ()))

    def _go_back(self) -> None:
        """Work no more, and show the last layout that was finished instead of one on the way."""
        self._busy = None
        if self.is_early and self._last is not None and self._last.shown is not None:
            self._now = self._last
            self.layout += 1
            self.is_early, self._last = False, None

    def _mourn(self, how: str) -> None:
        with self._changed:
            said = f"the process that flattens {how}; nothing is lost: try again, or undo the last change"
            for job in self._answers:
                self._answers[job] = ({"error": said}, b"")
            self._go_back()
            self._trouble = {"text": said, "repair": False}
            self._tell()

    def _tell(self) -> None:
        self.version += 1
        self._changed.notify_all()
        for listener in self._listeners:
            listener()
