"""Which studies errors are measured with, by the keys ``role`` and ``subject`` of their files.

A subject has a ``reference``, an ensemble on the finest mesh. ``accuracy`` varies one setting at a time, ``scatter`` is an
ensemble on another mesh, ``referee`` is what CalculiX itself finds on a fine one; ``shells`` adds elements of which only volumes
are known.
"""

from __future__ import annotations

from limo.config.project import Project
from limo.schema.study import ROLES, Role, Study

#: roles of which all runs are solved once and kept, because they take hours
KEPT_ROLES: tuple[Role, ...] = ("reference", "referee")
#: roles of which short runs are timed several times
TIMED_ROLES: tuple[Role, ...] = ("accuracy", "shells")


def subjects(project: Project) -> list[str]:
    """The subjects that have a reference."""
    return [study.subject for study in project.studies.values() if study.role == "reference"]


def studies_of(project: Project, subject: str) -> dict[Role, str]:
    """The studies of a subject by their roles, in the order of ``ROLES``."""
    names = {study.role: name for name, study in project.studies.items() if study.role and study.subject == subject}
    return {role: names[role] for role in ROLES if role in names}


def error_studies(project: Project) -> list[str]:
    """The studies that errors are gathered from: those of all subjects that have a reference."""
    return [name for subject in subjects(project) for name in studies_of(project, subject).values()]


def is_kept(study: Study) -> bool:
    """Whether all runs of a study are solved once and kept."""
    return study.role in KEPT_ROLES


def is_timed(study: Study) -> bool:
    """Whether short runs of a study are timed several times."""
    return study.role in TIMED_ROLES
