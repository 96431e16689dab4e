"""Results and state of the monitor in SQL, and the archive of samples; independent of the model of a vehicle."""

from sprung._checks import missing_package

try:
    from sprung.online.store.fleet import ChangeRow, FleetCounts, FleetFilter, FleetRow, Place, WindowRow
    from sprung.online.store.retention import MAX_COUNTED, Contents, Counted, Retention
    from sprung.online.store.schema import (
        AccountRow,
        AlertFilter,
        AlertPlace,
        AuditRow,
        BaselineRow,
        CommandRow,
        Cursor,
        Delivery,
        Entry,
        HistoryRow,
        NotificationRow,
        Progress,
        QuarantineRow,
        RefusedError,
        ReservationLostError,
        Snapshot,
        StoredFrame,
        StoreError,
        TokenRow,
        VehicleRow,
        VerdictRow,
    )
    from sprung.online.store.store import Store, check_address, open_store
except ImportError as error:
    raise missing_package(error, "sqlalchemy", purpose="the store", extra="online") from None

__all__ = [
    "MAX_COUNTED",
    "AccountRow",
    "AlertFilter",
    "AlertPlace",
    "AuditRow",
    "BaselineRow",
    "ChangeRow",
    "CommandRow",
    "Contents",
    "Counted",
    "Cursor",
    "Delivery",
    "Entry",
    "FleetCounts",
    "FleetFilter",
    "FleetRow",
    "HistoryRow",
    "NotificationRow",
    "Place",
    "Progress",
    "QuarantineRow",
    "RefusedError",
    "ReservationLostError",
    "Retention",
    "Snapshot",
    "Store",
    "StoreError",
    "StoredFrame",
    "TokenRow",
    "VehicleRow",
    "VerdictRow",
    "WindowRow",
    "check_address",
    "open_store",
]
