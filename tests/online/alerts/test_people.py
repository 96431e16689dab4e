"""Every state of an alert against everything that can happen to it, as a table."""

from dataclasses import replace

import pytest

from sprung.errors import ParameterError
from sprung.online.alerts import (
    AlertSettings,
    Report,
    absent,
    acknowledged,
    assigned,
    commented,
    reported,
    shelf_ended,
    shelved,
    unshelved,
)
from sprung.state import AlertState

NOW, SHELF = 1000, 2000
CAUSE = "front_left.spring"
SETTINGS = AlertSettings(raise_after=1, clear_after=1)


def report(severity=500, text="softer", **fields):
    return Report(**{"vehicle": "car", "cause": CAUSE, "severity": severity, "text": text, **fields})


def an_alert(is_active, is_acknowledged, shelved_until=None):
    alert = AlertState("car", CAUSE, 500, "softer", 1, is_active, is_acknowledged, shelved_until)
    return replace(alert, worst=500, notified=1, cleared=None if is_active else 2)


STATES = {
    "U": an_alert(True, False),
    "A": an_alert(True, True),
    "R": an_alert(False, False),
    "N": an_alert(False, True),
    "SU": an_alert(True, False, SHELF),
    "SA": an_alert(True, True, SHELF),
    "SR": an_alert(False, False, SHELF),
    "SN": an_alert(False, True, SHELF),
    "0": None,
}
EVENTS = {
    "report": lambda alert: reported(alert, report(), SETTINGS, NOW),
    "worse": lambda alert: reported(alert, report(700), SETTINGS, NOW),
    "absent": lambda alert: absent(alert, SETTINGS, NOW),
    "acknowledge": lambda alert: acknowledged(alert, "ann", NOW, "seen"),
    "shelve": lambda alert: shelved(alert, "ann", SHELF, NOW, "seen"),
    "unshelve": lambda alert: unshelved(alert, "ann", NOW, "seen"),
    "end of shelf": lambda alert: shelf_ended(alert, SHELF),
    "assign": lambda alert: assigned(alert, "ann", "bob", NOW, "seen"),
    "comment": lambda alert: commented(alert, "ann", NOW, "seen"),
}
# What happened, the state after it, and "!" where people are notified. "-": refused.
TABLE = """
              | U             | A             | R             | N           | SU             | SA             | SR             | SN            | 0
 report       | updated U     | updated A     | raised U !    | raised U !  | updated SU     | updated SA     | raised SU      | raised SU     | raised U !
 worse        | updated U !   | updated U !   | raised U !    | raised U !  | updated SU     | updated SU     | raised SU      | raised SU     | raised U !
 absent       | cleared R !   | cleared N !   | none R        | none N      | cleared SR     | cleared SN     | none SR        | none SN       |
 acknowledge  | acknowledged A| -             | acknowledged N| -           | acknowledged SA| -              | acknowledged SN| -             |
 shelve       | shelved SU    | shelved SA    | shelved SR    | shelved SN  | shelved SU     | shelved SA     | shelved SR     | shelved SN    |
 unshelve     | -             | -             | -             | -           | unshelved U !  | unshelved A !  | unshelved R    | unshelved N   |
 end of shelf | none U        | none A        | none R        | none N      | unshelved U !  | unshelved A !  | unshelved R    | unshelved N   |
 assign       | assigned U    | assigned A    | assigned R    | assigned N  | assigned SU    | assigned SA    | assigned SR    | assigned SN   |
 comment      | commented U   | commented A   | commented R   | commented N | commented SU   | commented SA   | commented SR   | commented SN  |
"""  # noqa: E501


def cells():
    heads, *rows = [[cell.strip() for cell in line.split("|")] for line in TABLE.strip("\n").splitlines()]
    return [
        pytest.param(row[0], head, cell, id=f"{head} {row[0]}")
        for row in rows
        for head, cell in zip(heads[1:], row[1:], strict=True)
        if cell
    ]


def letter(alert):
    return ("S" if alert.shelved_until else "") + {
        (True, False): "U",
        (True, True): "A",
        (False, False): "R",
        (False, True): "N",
    }[alert.is_active, alert.is_acknowledged]


@pytest.mark.parametrize(("event", "state", "cell"), cells())
def test_table(event, state, cell) -> None:
    before = STATES[state]
    if cell == "-":
        with pytest.raises(ParameterError, match=f"alert '{CAUSE}' of 'car' is .*: "):
            EVENTS[event](before)
        return
    transition = EVENTS[event](before)
    after = transition.alert
    assert " ".join([transition.what, letter(after), *"!" * transition.is_notified]) == cell
    assert (transition.what == "none") == (after == before)
    assert (
        (transition.who == "ann") == (transition.comment == "seen") == (event in list(EVENTS)[3:6] + list(EVENTS)[7:])
    )
    if transition.what != "none":
        assert after.updated == (SHELF if event == "end of shelf" else NOW)
    if before is not None:
        assert after.count == before.count + (transition.what == "raised")
    if transition.is_notified and transition.what != "cleared":
        assert after.notified == after.updated
    elif transition.what == "raised":
        assert after.notified is None


def test_life_of_an_alert() -> None:
    settings = AlertSettings(raise_after=2, clear_after=2)
    first = reported(None, report(300), settings, 10)
    assert (first.what, first.alert.count, first.alert.streak, first.alert.state) == (
        "pending",
        0,
        1,
        "normal",
    )
    risen = reported(first.alert, report(500, "much softer", evidence={"change": -0.2}), settings, 20).alert
    assert (risen.raised, risen.severity, risen.text, risen.evidence) == (20, 500, "much softer", {"change": -0.2})
    gone = absent(absent(risen, settings, 30).alert, settings, 40).alert
    assert (gone.cleared, gone.text, gone.count) == (40, "much softer", 1)
    again = reported(gone, report(900, "gone"), settings, 50)
    assert (again.what, again.alert.text, again.alert.severity) == ("pending", "much softer", 500)
    again = reported(again.alert, report(900, "gone"), settings, 60)
    assert (again.what, again.alert.text, again.alert.count, again.alert.raised) == ("raised", "gone", 2, 60)
    assert again.alert.cleared is None


def test_hold_off_starts_again_after_an_absence() -> None:
    settings = AlertSettings(raise_after=2)
    one = absent(reported(None, report(), settings, 1).alert, settings, 2)
    assert (one.what, one.alert.streak, one.is_notified) == ("pending", 0, False)
    assert reported(one.alert, report(), settings, 3).what == "pending"
    assert absent(one.alert, settings, 3).what == "none"


def test_what_was_never_active_cannot_be_acknowledged() -> None:
    held = reported(None, report(), AlertSettings(raise_after=2), 1).alert
    with pytest.raises(ParameterError, match="was never active"):
        acknowledged(held, "ann", 2)


def test_severity_between_two_steps_tells_once() -> None:
    alert = reported(None, report(590), SETTINGS, 0).alert
    notified = []
    for now, severity in enumerate([610, 590, 610, 700, 800, 801, 610, 1000], start=1):
        transition = reported(alert, report(severity), SETTINGS, now)
        alert = transition.alert
        notified.append(transition.is_notified)
        assert alert.severity == severity
    assert notified == [True, False, False, False, False, True, False, False]


def test_higher_severity_on_the_shelf_takes_back_the_acknowledgement_once() -> None:
    alert = reported(STATES["SA"], report(900), SETTINGS, 10).alert
    assert not alert.is_acknowledged
    alert = acknowledged(alert, "ann", 11).alert
    assert reported(alert, report(900), SETTINGS, 12).alert.is_acknowledged


def test_unknown_worst_is_the_present_severity() -> None:
    alert = replace(STATES["A"], worst=0)
    assert not reported(alert, report(), SETTINGS, NOW).is_notified
    assert reported(alert, report(700), SETTINGS, NOW).is_notified


def test_reminders_until_it_is_acknowledged() -> None:
    settings = AlertSettings(renotify_after=100)
    alert = reported(None, report(), settings, 0).alert
    notified = []
    for now in range(25, 375, 25):
        if now == 225:
            alert = acknowledged(alert, "ann", now).alert
        transition = reported(alert, report(), settings, now)
        alert = transition.alert
        notified += [now] * transition.is_notified
    assert notified == [100, 200]
    assert not reported(alert, report(), settings, 10_000).is_notified


def test_shelf_is_over_at_its_time_and_not_before() -> None:
    assert shelf_ended(STATES["SU"], SHELF - 1).what == "none"
    assert shelf_ended(STATES["SU"], SHELF).what == "unshelved"
    longer = shelved(STATES["SU"], "ann", SHELF + 5, NOW).alert
    assert shelf_ended(longer, SHELF).what == "none"


def test_assignee_stays_through_a_recurrence_and_can_be_taken_back() -> None:
    alert = assigned(STATES["R"], "ann", "bob", 5).alert
    alert = reported(alert, report(), SETTINGS, 6).alert
    assert alert.assignee == "bob"
    assert assigned(alert, "ann", None, 7).alert.assignee is None


@pytest.mark.parametrize(
    ("act", "sentence"),
    [
        (lambda: shelved(STATES["U"], "ann", NOW, NOW), "until=1000 is not after now"),
        (lambda: acknowledged(STATES["U"], " ", NOW), "who is empty: name the operator who wants to acknowledge"),
        (lambda: assigned(STATES["U"], "ann", None, NOW), "assigned to nobody already"),
        (lambda: assigned(STATES["U"], "ann", "", NOW), "is empty: give a name"),
        (lambda: commented(STATES["U"], "ann", NOW, " "), "is empty: write"),
        (
            lambda: reported(STATES["U"], report(vehicle="van"), SETTINGS, NOW),
            "report of van .* does not belong to the alert of car",
        ),
        (lambda: reported(STATES["U"], report(cause="silent"), SETTINGS, NOW), "give the alert of the same"),
        (lambda: report(0), "severity=0 must be at least 1"),
        (lambda: report(1001), "severity=1001 must be .*at most 1000"),
        (lambda: report(cause=""), "must not be empty"),
        (lambda: replace(STATES["U"], severity=0), "severity=0"),
        (lambda: AlertSettings(raise_after=0), "raise_after=0 must be at least 1"),
        (lambda: AlertSettings(clear_after=0), "clear_after=0 must be at least 1"),
        (lambda: AlertSettings(renotify_after=0), "renotify_after=0 must be above 0"),
    ],
)
def test_refusals(act, sentence) -> None:
    with pytest.raises(ParameterError, match=sentence):
        act()
