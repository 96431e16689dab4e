"""Types of arrays by what they hold, and how JSON holds them."""

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
    from pydantic_core import CoreSchema


class _AsLists:
    """Annotation by which pydantic reads and writes an array as nested lists; NaN and infinity are null in JSON.

    Complex arrays are objects with their parts, `real` and `imag`.
    """

    def __init__(self, dtype: type[np.generic]) -> None:
        self._dtype = dtype
        self._is_complex = issubclass(dtype, np.complexfloating)

    def __get_pydantic_core_schema__(self, source: Any, handler: "GetCoreSchemaHandler") -> "CoreSchema":
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(
            self._array, serialization=core_schema.plain_serializer_function_ser_schema(self._lists)
        )

    def __get_pydantic_json_schema__(self, schema: "CoreSchema", handler: "GetJsonSchemaHandler") -> dict[str, Any]:
        lists: dict[str, Any] = {"type": "array", "items": {"type": ["number", "null", "array"]}}
        if not self._is_complex:
            return lists
        return {"type": "object", "properties": {"real": lists, "imag": lists}, "required": ["real", "imag"]}

    def _array(self, value: Any) -> NDArray[Any]:
        if self._is_complex and isinstance(value, dict):
            return np.asarray(value["real"], dtype=np.float64) + 1j * np.asarray(value["imag"], dtype=np.float64)
        return np.asarray(value, dtype=self._dtype)

    def _lists(self, array: NDArray[Any]) -> Any:
        return {"real": array.real.tolist(), "imag": array.imag.tolist()} if self._is_complex else array.tolist()


Real = Annotated[NDArray[np.float64], _AsLists(np.float64)]
Complex = Annotated[NDArray[np.complex128], _AsLists(np.complex128)]
Indices = NDArray[np.intp]
Booleans = NDArray[np.bool_]
