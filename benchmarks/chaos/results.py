"""What a run came to."""

from dataclasses import dataclass, field

#: Fewest acknowledgements of a storm that shows anything.
LEAST_ACKNOWLEDGEMENTS = 100


@dataclass
class Result:
    """What a run came to."""

    seed: int
    kills: dict[str, int] = field(default_factory=dict)
    cuts: int = 0
    frames: int = 0
    sent_to_monitor: int = 0
    lost_on_the_way: int = 0
    doubled_on_the_way: int = 0
    delayed: int = 0
    damaged: int = 0
    boots: int = 0
    windows: int = 0
    findings: int = 0
    acknowledgements: int = 0
    acknowledgements_in_storm: int = 0
    acknowledged_not_stored: int = 0
    frames_lost: int = 0
    frames_left: int = 0
    windows_doubled: int = 0
    orphans: int = 0
    failures: list[str] = field(default_factory=list)
    is_equal: bool = False
    differs: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def is_kept(self) -> bool:
        """Whether every promise was kept, while frames came and were acknowledged."""
        return self.is_equal and self.is_sound and self.acknowledgements_in_storm >= LEAST_ACKNOWLEDGEMENTS

    @property
    def is_sound(self) -> bool:
        """Whether no promise has been broken so far."""
        faults = (
            self.acknowledged_not_stored,
            self.frames_lost,
            self.frames_left,
            self.windows_doubled,
            self.orphans,
            len(self.failures),
        )
        return not any(faults)
