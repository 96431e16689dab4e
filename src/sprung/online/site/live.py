"""Live events of the store, health and figures: what programs watch."""

import asyncio
import json
import re
from collections.abc import AsyncGenerator, Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Annotated, Any, NamedTuple, TypeVar

from fastapi import APIRouter, Header, HTTPException, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse, Response, StreamingResponse
from prometheus_client import CollectorRegistry
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.registry import Collector
from pydantic import BaseModel

from sprung.errors import SprungError
from sprung.online.monitor import FIGURES
from sprung.online.site.accounts import Allowed, Role, Viewer
from sprung.online.site.shared import LIMITS, Shared, column_number, context_of
from sprung.online.store import Store

api = APIRouter(tags=["live"])


class Mark(NamedTuple):
    """Place up to which the store was read: number of the last change of an alert, time of the last stored window."""

    change: int = 0
    window: int = 0

    def __str__(self) -> str:
        """Return the identifier of an event."""
        return f"{self.change}-{self.window}"

    @classmethod
    def parse(cls, text: str) -> "Mark | None":
        """Return the mark of an identifier; None if it is not a mark."""
        try:
            change, window = map(column_number, text.split("-"))
        except ValueError:
            return None
        return cls(change, window)


class Event(NamedTuple):
    """An event as it is sent, with the mark after it."""

    mark: Mark
    text: str

    @classmethod
    def of(cls, mark: Mark, kind: str, **data: Any) -> "Event":
        """Return an event of a kind, and what it is about."""
        return cls(mark, f"id: {mark}\nevent: {kind}\ndata: {json.dumps(data)}\n\n")


class Feed:
    """Changes in a store for all listeners.

    Parameters
    ----------
    store
        Store of the monitor.
    look
        Time between polls of it [s].
    """

    def __init__(self, store: Store, *, look: float = LIMITS.poll) -> None:
        self._store = store
        self._look = look
        self._listeners: set[asyncio.Queue[Event | None]] = set()
        self._task: asyncio.Task[None] | None = None
        self._starting = asyncio.Lock()
        self._mark = Mark()

    @property
    def n_listeners(self) -> int:
        """Number of listeners."""
        return len(self._listeners)

    async def listen(self, after: Mark | None) -> AsyncGenerator[str, None]:
        """Yield events as text, from a mark on, or from now on; and a sign of life when nothing happens.

        Parameters
        ----------
        after
            Mark of the last event that the listener has; None: none.
        """
        queue: asyncio.Queue[Event | None] = asyncio.Queue(LIMITS.max_waiting)
        async with self._starting:  # of several at the same time, one starts polling the store
            if self._task is None or self._task.done():
                self._mark = await run_in_threadpool(lambda: Mark(*self._store.fleet.newest()))
                self._task = asyncio.create_task(self._run())
        reached = self._mark if after is None else after
        self._listeners.add(queue)
        try:
            yield f"retry: 3000\nid: {reached}\n\n"
            while after is not None and (missed := await run_in_threadpool(self._since, reached)):
                for event in missed:
                    reached = event.mark
                    yield event.text
            while True:
                try:
                    async with asyncio.timeout(LIMITS.heartbeat):
                        following = await queue.get()
                except TimeoutError:
                    yield ": nothing new\n\n"
                    continue
                if following is None:
                    return
                if following.mark.change > reached.change or following.mark.window > reached.window:
                    yield following.text
        finally:
            self._listeners.discard(queue)

    async def close(self) -> None:
        """End all listening."""
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task
        for queue in self._listeners:
            _cut_off(queue)

    async def _run(self) -> None:
        """Look for changes while anybody listens."""
        while self._listeners:
            await asyncio.sleep(self._look)
            try:
                events = await run_in_threadpool(self._since, self._mark)
            except (SprungError, OSError):
                continue  # the store does not answer: /health states it
            for event in events:
                self._mark = event.mark
                for queue in list(self._listeners):
                    if queue.full():
                        self._listeners.discard(queue)
                        _cut_off(queue)
                    else:
                        queue.put_nowait(event)

    def _since(self, mark: Mark) -> list[Event]:
        """Return changes of alerts after a mark, then windows, each with the mark after it."""
        changes, windows = self._store.fleet.since(mark.change, mark.window, limit=LIMITS.max_events)
        events = []
        for row in changes:
            mark = Mark(row.id, mark.window)
            events.append(Event.of(mark, "alert", number=row.alert, vehicle=row.vehicle, what=row.what))
        for window in windows:
            mark = Mark(mark.change, window.stored)
            events.append(Event.of(mark, "window", vehicle=window.vehicle, boot=window.boot, number=window.number))
        return events


@api.get("/events", response_class=StreamingResponse, responses={200: {"content": {"text/event-stream": {}}}})
async def events(
    request: Request, _: Viewer, last_event_id: Annotated[str | None, Header(max_length=40)] = None
) -> StreamingResponse:
    """Changes of alerts ("alert") and analysed windows ("window") as server-sent events, as they happen."""
    after = None if last_event_id is None else Mark.parse(last_event_id)
    headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
    return StreamingResponse(request.app.state.feed.listen(after), media_type="text/event-stream", headers=headers)


def _cut_off(queue: asyncio.Queue[Event | None]) -> None:
    """Let the listener of a queue end: it continues from the last event that it received."""
    while not queue.empty():
        queue.get_nowait()
    queue.put_nowait(None)


T = TypeVar("T")

router = APIRouter(tags=["site"])

#: Threads of their own: those of the other requests may all wait for the same store.
_POOL = ThreadPoolExecutor(4, thread_name_prefix="metrics")


class Health(BaseModel):
    """Whether the monitor is healthy, and a sentence about each problem."""

    healthy: bool
    problems: list[str]


@router.get("/health", response_model=Health, responses={503: {"model": Health, "description": "Not healthy."}})
async def health(request: Request) -> JSONResponse:
    """Whether the monitor is healthy, and what is not; it needs no store and no log-in."""
    problems = context_of(request).problems()
    return JSONResponse({"healthy": not problems, "problems": problems}, 503 if problems else 200)


@router.get("/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}})
async def metrics(request: Request, context: Shared) -> Response:
    """Figures for Prometheus; those of the store are left out if it fails or takes too long.

    Programs of this machine need no log-in: a store that does not answer must not withhold the figures from them.
    """
    if not context.is_private and await _in_time(lambda: Allowed(Role.VIEWER)(request)) is None:
        raise HTTPException(503, "the store does not answer: try again later, and see /health")
    store = context.store
    stored = await _in_time(
        lambda: {"sprung_alerts_active": float(store.alerts.n_active()), "sprung_store_bytes": float(store.size())}
    )
    figures = {**context.figures(), **({"sprung_store_writable": 0.0} if stored is None else stored)}
    return Response(exposition(figures), media_type=CONTENT_TYPE_PLAIN_0_0_4)


class _Figures(Collector):
    """Figures as Prometheus collects them; a name may be followed by labels in braces."""

    def __init__(self, figures: Mapping[str, float]) -> None:
        self._figures = figures

    def collect(self) -> Iterable[Metric]:
        """Yield each kind of figure with its samples."""
        families: dict[str, CounterMetricFamily | GaugeMetricFamily] = {}
        for key, value in self._figures.items():
            name, _, braced = key.partition("{")
            labels = dict(re.findall(r'(\w+)="([^"]*)"', braced))
            if name not in families:
                kind, meaning = FIGURES[name]
                family = CounterMetricFamily if kind == "counter" else GaugeMetricFamily
                families[name] = family(name, meaning, labels=list(labels))
            families[name].add_metric(list(labels.values()), value)
        yield from (families[name] for name in FIGURES if name in families)


def exposition(figures: Mapping[str, float]) -> bytes:
    """Return figures in the text format of Prometheus."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Figures(figures))
    return generate_latest(registry)


async def _in_time(act: Callable[[], T]) -> T | None:
    """Return what a function of the store returns; None if it fails, or takes too long."""
    try:
        return await asyncio.wait_for(asyncio.get_running_loop().run_in_executor(_POOL, act), LIMITS.store_timeout)
    except (SprungError, OSError, TimeoutError):
        return None
