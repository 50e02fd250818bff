"""What the mission service refuses, each with the reason and what to do about it."""


class MissionError(Exception):
    """Base. ``str()`` says what is wrong, ``remedy`` what would be right."""

    remedy: str = ""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


class MissionNotFoundError(MissionError):
    """There is no such mission."""


class NotAMemberError(MissionError):
    """The process is none of those that share the database now: it can have no mission."""


class MissionUnreadableError(MissionError):
    """A mission is stored in a way that cannot be opened, as when a newer version wrote it."""


class SiteNotFoundError(MissionError):
    """There is no such site."""


class VehicleNotFoundError(MissionError):
    """There is no such vehicle, or it takes no part in the mission."""


class TargetNotFoundError(MissionError):
    """The mission has no such target."""


class ConflictError(MissionError):
    """The request contradicts the present state of things."""


class InvalidRequestError(MissionError):
    """A field's value cannot be taken; ``field`` names it as a path, for example ``planner.options.window``."""

    def __init__(self, field: str, message: str, remedy: str = "") -> None:
        super().__init__(message, remedy)
        self.field = field


class AlarmNotFoundError(MissionError):
    """There is no such alarm."""


class ImportNotFoundError(MissionError):
    """There is no such import, or no reference grid."""


class FileTooLargeError(MissionError):
    """A file is longer than is taken."""


class ImportUnavailableError(MissionError):
    """No file can be taken in or read now."""


class ProductUnavailableError(MissionError):
    """A file could not be made to its end now."""


class SoundingNotFoundError(MissionError):
    """There is no such sounding in the mission."""


class CastNotFoundError(MissionError):
    """The mission has no sound speed cast of this name."""


class BeamEditNotFoundError(MissionError):
    """Nothing with this number was said of the mission's beams, or it was taken back."""


class PingsNotFoundError(MissionError):
    """The mission has no such file of pings."""


class PingsUnreadableError(MissionError):
    """A file of pings is missing or damaged."""


class MapNotReadyError(MissionError):
    """No sounding was accepted yet, so there is no map."""


class MissionElsewhereError(MissionError):
    """Another process has this mission, or none has it at the moment; this one may not touch it."""
