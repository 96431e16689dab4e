"""The refusal of work that is done one at a time."""

from sprung.errors import SprungError


class BusyError(SprungError):
    """Work that cannot begin now, or is not yet done, such as a report while another one is being written."""
