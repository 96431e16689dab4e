"""/health for supervisors, and /metrics for Prometheus."""

import asyncio
import re
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from fastapi import APIRouter, HTTPException, Request
from fastapi.responses import JSONResponse, Response
from prometheus_client import CollectorRegistry
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.registry import Collector
from pydantic import BaseModel

from sprung.errors import SprungError
from sprung.online.monitor import FIGURES
from sprung.online.site.accounts import Allowed, Role
from sprung.online.site.shared import LIMITS, Shared, context_of

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
