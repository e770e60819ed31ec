-- Panoramas that pictures are lit with.
CREATE TABLE environments (
    seq    INTEGER PRIMARY KEY AUTOINCREMENT,
    id     TEXT NOT NULL UNIQUE,
    format TEXT NOT NULL,
    width  INTEGER NOT NULL,
    height INTEGER NOT NULL,
    file   TEXT NOT NULL
) STRICT;
CREATE INDEX environments_by_file ON environments (file);
