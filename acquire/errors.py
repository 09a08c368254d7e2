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


class DiskFull(AcquireError):
    """The log cannot be written any more."""

    ended = Ended.DISK_FULL


class Interrupted(AcquireError):
    """The person at the keyboard has had enough."""

    ended = Ended.INTERRUPTED
