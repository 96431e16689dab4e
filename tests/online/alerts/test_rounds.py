"""Rounds of a vehicle: tables, and random histories against a count of their own."""

import pytest
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from sprung.errors import ParameterError
from sprung.online.alerts import AlertSettings, Report, acknowledged, assess, shelved, unshelved
from sprung.state import is_of_suspension, severity_step

CAUSES = ("front_left.spring", "rear_right.damper", "sensor:acc_fl", "silent")
ONCE = AlertSettings(raise_after=1, clear_after=1)


def report(cause, severity=500, vehicle="car"):
    return Report(vehicle, cause, severity, f"{cause} at {severity}")


def play(alerts, reports, *, looked_for=lambda cause: True, is_inhibited=False, settings=ONCE, now=0):
    transitions = assess(alerts, reports, looked_for=looked_for, is_inhibited=is_inhibited, settings=settings, now=now)
    return {**alerts, **{one.alert.cause: one.alert for one in transitions}}, transitions


def said(transitions):
    return [(one.alert.cause, one.what, one.is_notified) for one in transitions]


@pytest.fixture
def all_active():
    return play({}, [report(cause) for cause in CAUSES])[0]


def test_reported_rise_and_absent_clear(all_active) -> None:
    alerts, transitions = play(all_active, [report("silent")], now=1)
    assert said(transitions) == [("silent", "updated", False), *((cause, "cleared", True) for cause in CAUSES[:3])]
    assert play(alerts, [report("silent")], now=2)[1][1:] == []


def test_what_nobody_looked_for_is_not_absent(all_active) -> None:
    _, transitions = play(all_active, [], looked_for=lambda cause: cause.startswith("sensor:"), now=1)
    assert said(transitions) == [("sensor:acc_fl", "cleared", True)]


def test_inhibited_suspension_neither_rises_nor_clears(all_active) -> None:
    _, transitions = play(all_active, [], is_inhibited=True, now=1)
    assert said(transitions) == [("sensor:acc_fl", "cleared", True), ("silent", "cleared", True)]
    alerts, transitions = play({}, [report(cause) for cause in CAUSES], is_inhibited=True)
    assert list(alerts) == ["sensor:acc_fl", "silent"]
    assert all(one.what == "raised" for one in transitions)


def test_inhibition_keeps_the_counts() -> None:
    settings = AlertSettings(raise_after=2)
    alerts, _ = play({}, [report(CAUSES[0])], settings=settings)
    alerts, none = play(alerts, [], is_inhibited=True, settings=settings)
    assert none == []
    assert said(play(alerts, [report(CAUSES[0])], settings=settings)[1]) == [(CAUSES[0], "raised", True)]


def test_several_reports_of_a_cause_are_one_of_the_worst() -> None:
    settings = AlertSettings(raise_after=2)
    alerts, transitions = play({}, [report("monitor", s) for s in (300, 700, 500)], settings=settings)
    assert [one.what for one in transitions] == ["pending"]
    assert (alerts["monitor"].severity, alerts["monitor"].streak) == (700, 1)


def test_shelves_end_before_the_round(all_active) -> None:
    alerts = {"silent": shelved(all_active["silent"], "ann", 10, 1).alert}
    assert said(play(alerts, [report("silent", 900)], now=9)[1]) == [("silent", "updated", False)]
    after, transitions = play(alerts, [], now=10)
    assert said(transitions) == [("silent", "unshelved", True), ("silent", "cleared", True)]
    assert not after["silent"].is_active
    assert not after["silent"].is_shelved


def test_a_round_is_of_one_vehicle(all_active) -> None:
    with pytest.raises(ParameterError, match="this one car, van: assess each separately"):
        play(all_active, [report("silent", vehicle="van")])


class History(RuleBasedStateMachine):
    """Random rounds and acts; whether an alert is active is read off the history of its windows, counted afresh."""

    @initialize(raise_after=st.integers(1, 4), clear_after=st.integers(1, 4), renotify=st.sampled_from([None, 3]))
    def start(self, raise_after, clear_after, renotify):
        self.settings = AlertSettings(raise_after, clear_after, renotify)
        self.alerts, self.now = {}, 0
        # Whether it was reported, in every conclusive window.
        self.windows: dict[str, list[bool]] = {cause: [] for cause in CAUSES}
        self.rises = dict.fromkeys(CAUSES, 0)
        self.worst = dict.fromkeys(CAUSES, 0)  # since the last rise

    def active(self, cause):
        """The last of all runs that was long enough decides."""
        is_active, run, last = False, 0, None
        for seen in self.windows[cause]:
            run, last = (run + 1 if seen == last else 1), seen
            if run >= (self.settings.raise_after if seen else self.settings.clear_after):
                is_active = seen
        return is_active

    @rule(
        found=st.dictionaries(st.sampled_from(CAUSES), st.integers(1, 1000)),
        blind=st.sets(st.sampled_from(CAUSES), max_size=2),
        is_inhibited=st.booleans(),
    )
    def window(self, found, blind, is_inhibited):
        self.now += 1
        before, was_active = self.alerts, {cause: self.active(cause) for cause in CAUSES}
        self.alerts, transitions = play(
            before,
            [report(*one) for one in found.items()],
            looked_for=lambda cause: cause not in blind,
            is_inhibited=is_inhibited,
            settings=self.settings,
            now=self.now,
        )
        for cause in CAUSES:
            if not (is_inhibited and is_of_suspension(cause)) and (cause in found or cause not in blind):
                self.windows[cause].append(cause in found)
        rounds = [one for one in transitions if one.what != "unshelved"]
        assert len({one.alert.cause for one in rounds}) == len(rounds)
        for one in rounds:
            self.check_window(one, before.get(one.alert.cause), was_active[one.alert.cause])

    def check_window(self, transition, before, was_active):
        alert, cause = transition.alert, transition.alert.cause
        is_worse = severity_step(alert.severity) > severity_step(max(1, self.worst[cause]))
        if transition.what == "raised":
            assert not was_active
            self.rises[cause] += 1
            self.worst[cause] = alert.severity
        elif transition.what == "updated":
            assert was_active
            self.worst[cause] = max(self.worst[cause], alert.severity)
        assert (transition.what == "cleared") == (was_active and not self.active(cause))
        if transition.is_notified and transition.what != "cleared" and before is not None and before.is_acknowledged:
            assert transition.what == "raised" or is_worse
        if alert.is_shelved:
            assert not transition.is_notified
        elif transition.what in ("raised", "cleared") or (transition.what == "updated" and is_worse):
            assert transition.is_notified
        if transition.what == "raised" or (transition.what == "updated" and is_worse):
            assert not alert.is_acknowledged

    def choose(self, data, wanted):
        return data.draw(st.sampled_from(sorted(cause for cause, one in self.alerts.items() if wanted(one))))

    @precondition(lambda self: any(not one.is_acknowledged for one in self.alerts.values()))
    @rule(data=st.data())
    def acknowledge(self, data):
        cause = self.choose(data, lambda one: not one.is_acknowledged)
        self.alerts[cause] = acknowledged(self.alerts[cause], "ann", self.now).alert

    @precondition(lambda self: self.alerts)
    @rule(data=st.data(), span=st.integers(1, 5))
    def shelve(self, data, span):
        cause = self.choose(data, lambda one: True)
        self.alerts[cause] = shelved(self.alerts[cause], "ann", self.now + span, self.now).alert

    @precondition(lambda self: any(one.is_shelved for one in self.alerts.values()))
    @rule(data=st.data())
    def unshelve(self, data):
        cause = self.choose(data, lambda one: one.is_shelved)
        transition = unshelved(self.alerts[cause], "ann", self.now)
        assert transition.is_notified == self.active(cause)
        self.alerts[cause] = transition.alert

    @invariant()
    def holds(self):
        for cause, alert in getattr(self, "alerts", {}).items():
            assert alert.cause == cause
            assert alert.is_active == self.active(cause)
            assert alert.count == self.rises[cause]
            assert alert.is_active or alert.streak < self.settings.raise_after
            assert not alert.is_active or alert.streak < self.settings.clear_after
            assert (alert.cleared is None) == (alert.is_active or not alert.count)
            assert alert.count or alert.is_acknowledged


TestHistory = pytest.mark.slow(History.TestCase)
TestHistory.settings = hypothesis_settings(max_examples=150, stateful_step_count=40, deadline=None)
