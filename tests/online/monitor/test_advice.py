"""Advice on inspections: worked out beside the monitor's loop, once an hour, and kept where the store fails."""

from threading import Event

from sprung.online.monitor import housekeeping
from sprung.online.monitor.housekeeping import Advice
from sprung.online.store import StoreError

SENTENCE = (
    "to learn most about the type bus, inspect bus-3 next: with 40 % probability it deviates, "
    "most likely rear left damper -10 %"
)


def ranked(store):
    best = {"vehicle": "bus-3", "probability": 0.4, "part": "rear_left.damper", "change": -0.1}
    return {"types": [{"name": "bus", "inspect_next": best}, {"name": "van", "inspect_next": None}]}


def test_advice_is_that_of_the_ranking_and_never_waited_for(store, monkeypatch) -> None:
    now, asked, goes_on = [0.0], [], Event()

    def ranking(opened):
        asked.append(opened)
        goes_on.wait(30)
        return ranked(opened)

    monkeypatch.setattr(housekeeping, "ranking_document", ranking)
    advice = Advice(store, lambda: now[0])
    for now[0] in (0.0, 1.0, 3601.0):  # the first ranking still goes on
        advice.step()
        assert advice.sentences == ()
    goes_on.set()
    advice.close()
    assert (advice.sentences, asked) == ((SENTENCE,), [store])
    advice.step()
    advice.close()
    now[0] += 3599
    advice.step()
    advice.close()
    assert asked == [store, store]


def test_a_store_that_fails_keeps_the_advice(store, monkeypatch, caplog) -> None:
    def failing(opened):
        raise StoreError("disk full")

    monkeypatch.setattr(housekeeping, "ranking_document", ranked)
    now = [0.0]
    advice = Advice(store, lambda: now[0])
    advice.step()
    advice.close()
    monkeypatch.setattr(housekeeping, "ranking_document", failing)
    now[0] = 3600.0
    advice.step()
    advice.close()
    assert advice.sentences == (SENTENCE,)
    assert "the fleet cannot be ranked: disk full" in caplog.text


def test_a_large_fleet_is_not_ranked(store, monkeypatch) -> None:
    monkeypatch.setattr(housekeeping, "_MAX_RANKED", -1)
    advice = Advice(store, lambda: 0.0)
    advice.step()
    advice.close()
    (sentence,) = advice.sentences
    assert "sprung vehicles rank" in sentence
