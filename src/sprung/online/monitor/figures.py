"""Names of the figures of the running monitor, for Prometheus."""

#: Name, kind and meaning of every figure.
FIGURES = {
    "sprung_vehicles": ("gauge", "Vehicles known."),
    "sprung_frames_total": ("counter", "Frames received and stored, including duplicates."),
    "sprung_messages_total": ("counter", "Messages received."),
    "sprung_message_age_seconds": ("gauge", "Time since the last message arrived."),
    "sprung_messages_refused_total": ("counter", "Messages refused, for any reason."),
    "sprung_refusals_total": ("counter", "Messages refused, by vehicle and reason."),
    "sprung_queue_bytes": ("gauge", "Bytes of messages waiting for intake."),
    "sprung_frames_lost_total": ("counter", "Frames that boxes had to drop."),
    "sprung_vehicle_frames_lost_total": ("counter", "Frames that the box of a vehicle had to drop."),
    "sprung_windows_total": ("counter", "Windows analysed."),
    "sprung_window_age_seconds": ("gauge", "Time since the last window was analysed."),
    "sprung_identifications_total": ("counter", "Identifications of modes."),
    "sprung_analysis_cpu_seconds_total": ("counter", "Processor time of the jobs of workers."),
    "sprung_failures_total": ("counter", "Jobs of workers that failed."),
    "sprung_frames_quarantined_total": (
        "counter",
        "Frames whose analysis fails or needs too much memory.",
    ),
    "sprung_states_quarantined_total": ("counter", "Saved states that could not be used."),
    "sprung_vehicles_waiting": ("gauge", "Vehicles that could not be opened and are retried later."),
    "sprung_vehicles_slow": ("gauge", "Vehicles that share the process for slow ones."),
    "sprung_workers_replaced_total": ("counter", "Processes that died or took too long."),
    "sprung_alerts_active": ("gauge", "Active alerts."),
    "sprung_notifications_sent_total": ("counter", "Notifications sent, counted per sender."),
    "sprung_notifications_given_up_total": ("counter", "Notifications given up, counted per sender."),
    "sprung_backlog_frames": ("gauge", "Frames stored and not yet analysed."),
    "sprung_backlog_age_seconds": ("gauge", "Age of the oldest frame waiting to be analysed."),
    "sprung_boxes_free_bytes": ("gauge", "Free disk space of the box that has the least."),
    "sprung_lake_windows_total": ("counter", "Windows written to the lake."),
    "sprung_lake_windows_waiting": ("gauge", "Windows waiting to be written to the lake."),
    "sprung_lake_failures_total": ("counter", "Failed attempts to write to the lake or to tidy it."),
    "sprung_link_connected": ("gauge", "1 while connected to the broker."),
    "sprung_active": ("gauge", "1 while this monitor works on the store, 0 while it stands by."),
    "sprung_store_bytes": ("gauge", "Size of the store."),
    "sprung_store_writable": ("gauge", "1 while the store can be written."),
    "sprung_heartbeat_age_seconds": ("gauge", "Time since each loop of the monitor last ran."),
}


def labelled(name: str, **labels: str) -> str:
    """Return the name of a figure with labels, whose values have neither quotes, backslashes nor line ends."""
    return name + "{" + ",".join(f'{label}="{value}"' for label, value in labels.items()) + "}"
