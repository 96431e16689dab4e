"""The functions of `sprung.results.figures` under the name that users of recordings know."""

from sprung.results.figures import *  # noqa: F403
