CREATE TABLE paints (
    seq         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    name        TEXT NOT NULL,
    source      TEXT NOT NULL,
    -- name and source in lower case, as they are searched
    words       TEXT NOT NULL,
    measurement TEXT,
    paint       TEXT NOT NULL,
    content     TEXT NOT NULL
) STRICT;
CREATE INDEX paints_by_measurement ON paints (measurement);
CREATE INDEX paints_by_paint ON paints (paint);

CREATE TABLE blends (
    seq     INTEGER PRIMARY KEY AUTOINCREMENT,
    id      TEXT NOT NULL UNIQUE,
    paints  TEXT NOT NULL,
    options TEXT NOT NULL,
    blend   TEXT NOT NULL
) STRICT;
CREATE INDEX blends_by_blend ON blends (blend);

CREATE TABLE jobs (
    seq      INTEGER PRIMARY KEY AUTOINCREMENT,
    id       TEXT NOT NULL UNIQUE,
    kind     TEXT NOT NULL,
    subject  TEXT NOT NULL,
    request  TEXT NOT NULL,
    state    TEXT NOT NULL DEFAULT 'queued',
    attempts INTEGER NOT NULL DEFAULT 0,
    problem  TEXT
) STRICT;
-- A paint or blend is made by one job at a time.
CREATE UNIQUE INDEX one_unfinished_job ON jobs (subject) WHERE state IN ('queued', 'running');
