"""What can go wrong with an instrument. Every message says what happened and what to do."""

from rotorid.io.session import Ended


class AcquireError(Exception):
    """Base; `ended` is what the session's metadata say."""

    ended = Ended.FAILED


class PortMissing(AcquireError):
    """No such port."""

    ended = Ended.DEVICE_LOST


class PortBusy(AcquireError):
    """Another program holds the port, or we may not open it."""

    ended = Ended.DEVICE_LOST


class PortLost(AcquireError):
    """The port went away while it was open."""

    ended = Ended.DEVICE_LOST


class DeviceSilent(AcquireError):
    """Nothing comes, or no answer."""

    ended = Ended.DEVICE_SILENT


class DeviceReset(AcquireError):
    """The device restarted in a run that cannot be resumed."""

    ended = Ended.DEVICE_RESET


class Refused(AcquireError):
    """The device refused a command, or is not the instrument that was asked for."""

    ended = Ended.REFUSED


class DeviceFault(AcquireError):
    """The device ended the stream by itself, and not because it was done."""

    ended = Ended.DEVICE_FAULT


class GaveUp(AcquireError):
    """A weight, a steady reading: what was waited for did not come in the time that was given."""

    ended = Ended.GAVE_UP


class LimitExceeded(AcquireError):
    """A reading went beyond what was allowed."""

    ended = Ended.LIMIT_EXCEEDED


class BadName(AcquireError):
    """A recording cannot be called that, or one is called that already."""


class CannotWrite(AcquireError):
    """The folder does not take the log."""


class DiskFull(AcquireError):
    """The log cannot be written any more. `stored`: the chunk in hand is whole on disk all the same."""

    ended = Ended.DISK_FULL
    stored = False


class Interrupted(AcquireError):
    """The person at the keyboard has had enough."""

    ended = Ended.INTERRUPTED
