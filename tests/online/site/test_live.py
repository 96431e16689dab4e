"""Live events: in order, each once, from where a listener stopped, and never more than it takes."""

import asyncio
import json
from dataclasses import replace

import pytest
from tests.online.site.conftest import NOW

from sprung.online.monitor import operations
from sprung.online.site import live
from sprung.online.site.live import Feed, Mark
from sprung.online.site.shared import LIMITS
from sprung.online.store import Progress, StoredFrame


def analyse(store, seq, now):
    """Store a window of bus-3."""
    store.inbox.add_frames([StoredFrame("bus-3", 1, seq, NOW, b"x")], now=now)
    store.results.commit(Progress("bus-3", 1, done_seq=seq, observations=((seq, NOW, {}),), now=now))


def parsed(text):
    """Identifier, kind and data of an event."""
    fields = dict(line.split(": ", 1) for line in text.strip().split("\n"))
    return fields["id"], fields.get("event", ""), json.loads(fields.get("data", "null"))


async def next_of(listening):
    async with asyncio.timeout(20.0):
        return parsed(await anext(listening))


def test_listeners_hear_what_happens_from_now_on(store) -> None:
    async def listen():
        feed = Feed(store, look=0.01)
        first, second = feed.listen(None), feed.listen(None)
        begun = [await next_of(each) for each in (first, second)]
        assert [kind for _, kind, _ in begun] == ["", ""]
        operations.acknowledge(store, 1, who="eve", now=NOW)
        analyse(store, 0, NOW + 1)
        heard = []
        for each in (first, second):
            heard.append([(kind, data) for _, kind, data in [await next_of(each), await next_of(each)]])
        await first.aclose()
        await second.aclose()
        assert feed.n_listeners == 0
        await feed.close()
        return heard

    one, other = asyncio.run(listen())
    assert one == other
    assert sorted(kind for kind, _ in one) == ["alert", "window"]
    assert ("alert", {"number": 1, "vehicle": "bus-1", "what": "acknowledged"}) in one
    assert ("window", {"vehicle": "bus-3", "boot": 1, "number": 0}) in one


def test_those_who_come_at_once_hear_everything_once(store) -> None:
    async def listen():
        feed = Feed(store, look=0.01)
        listening = [feed.listen(None) for _ in range(30)]
        await asyncio.gather(*(next_of(each) for each in listening))
        operations.add_comment(store, 1, who="eve", comment="first", now=NOW)
        first = await asyncio.gather(*(next_of(each) for each in listening))
        operations.add_comment(store, 1, who="eve", comment="second", now=NOW)
        second = await asyncio.gather(*(next_of(each) for each in listening))
        for each in listening:
            await each.aclose()
        assert feed.n_listeners == 0
        await feed.close()
        return {identity for identity, _, _ in first}, {identity for identity, _, _ in second}

    first, second = asyncio.run(listen())
    assert (len(first), len(second)) == (1, 1)
    assert first != second


@pytest.mark.parametrize("limit", [1, 1000])
def test_a_listener_continues_where_it_stopped(store, monkeypatch, limit) -> None:
    """Nothing is missed and nothing comes twice, in whatever portions the store is read."""
    monkeypatch.setattr(live, "LIMITS", replace(LIMITS, max_events=limit))

    async def listen():
        feed = Feed(store, look=0.01)
        before = Mark(*store.fleet.newest())
        operations.acknowledge(store, 1, who="eve", now=NOW)
        analyse(store, 0, NOW + 1)
        analyse(store, 1, NOW + 2)
        listening = feed.listen(before)
        await next_of(listening)
        heard = [await next_of(listening)]
        operations.add_comment(store, 1, who="eve", comment="late", now=NOW)
        heard += [await next_of(listening) for _ in range(3)]
        await listening.aclose()
        await feed.close()
        return heard

    heard = asyncio.run(listen())
    facts = sorted((kind, data.get("what", data["number"])) for _, kind, data in heard)
    assert facts == [("alert", "acknowledged"), ("alert", "commented"), ("window", 0), ("window", 1)]
    assert len({identity for identity, _, _ in heard}) == 4


def test_a_listener_that_takes_nothing_is_cut_off(store, monkeypatch) -> None:
    monkeypatch.setattr(live, "LIMITS", replace(LIMITS, max_waiting=2))

    async def listen():
        feed = Feed(store, look=0.01)
        listening = feed.listen(None)
        await next_of(listening)
        for number in range(4):
            operations.add_comment(store, 1, who="eve", comment=str(number), now=NOW)
        async with asyncio.timeout(20.0):
            while feed.n_listeners:
                await asyncio.sleep(0.01)
        with pytest.raises(StopAsyncIteration):
            await next_of(listening)
        await feed.close()

    asyncio.run(listen())


def test_an_idle_listener_gets_signs_of_life(store, monkeypatch) -> None:
    monkeypatch.setattr(live, "LIMITS", replace(LIMITS, heartbeat=0.01))

    async def listen():
        feed = Feed(store, look=0.01)
        listening = feed.listen(None)
        await next_of(listening)
        sign = await anext(listening)
        await listening.aclose()
        await feed.close()
        return sign

    assert asyncio.run(listen()) == ": nothing new\n\n"


@pytest.mark.parametrize("text", ["", "1", "1-", "-1", "a-b", "1-2-3", "9" * 19 + "-1"])
def test_what_is_no_mark_is_ignored(text) -> None:
    assert Mark.parse(text) is None
