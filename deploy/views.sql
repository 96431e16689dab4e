-- Views of the store for dashboards by SQL, on PostgreSQL and SQLite. Times are seconds since 1970 (UTC).
-- psql SPRUNG_DATABASE -f views.sql, or sqlite3 store.sqlite < views.sql; again after an upgrade.
-- Let the dashboard log in as a user of its own: GRANT SELECT ON dashboard_vehicles, dashboard_alerts,
-- dashboard_windows, dashboard_verdicts TO grafana.

DROP VIEW IF EXISTS dashboard_vehicles;
DROP VIEW IF EXISTS dashboard_alerts;
DROP VIEW IF EXISTS dashboard_windows;
DROP VIEW IF EXISTS dashboard_verdicts;

-- One row for each vehicle: severity is that of its worst active alert, 0 without one; baseline is the version in use.
CREATE VIEW dashboard_vehicles AS
SELECT v.vehicle, v.first_seen / 1000000000 AS first_seen, v.last_seen / 1000000000 AS last_seen, v.is_parked,
       COALESCE(s.is_learning, FALSE) AS is_learning,
       (SELECT MAX(b.version) FROM baselines b WHERE b.vehicle = v.vehicle) AS baseline,
       (SELECT COUNT(*) FROM alerts a WHERE a.vehicle = v.vehicle AND a.is_active) AS active_alerts,
       (SELECT COALESCE(MAX(a.severity), 0) FROM alerts a WHERE a.vehicle = v.vehicle AND a.is_active) AS severity,
       (SELECT COALESCE(SUM(c.lost), 0) FROM cursors c WHERE c.vehicle = v.vehicle) AS frames_lost
FROM vehicles v LEFT JOIN statuses s ON s.vehicle = v.vehicle;

-- One row for each alert; cause is the part, or what is wrong with a sensor or the monitor.
CREATE VIEW dashboard_alerts AS
SELECT number, vehicle, cause, severity, text AS sentence, raised / 1000000000 AS raised, cleared / 1000000000 AS cleared,
       is_active, is_acknowledged, assignee
FROM alerts;

-- Windows analysed, by vehicle and day on which they began.
CREATE VIEW dashboard_windows AS
SELECT vehicle, (t0 / 86400000000000) * 86400 AS day, COUNT(*) AS windows
FROM observations GROUP BY vehicle, t0 / 86400000000000;

-- What the workshop found about alerts.
CREATE VIEW dashboard_verdicts AS
SELECT w.alert, a.vehicle, a.cause, w.time / 1000000000 AS stated, w.verdict, w.part, w.action
FROM verdicts w JOIN alerts a ON a.number = w.alert;
