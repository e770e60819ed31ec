ALTER TABLE paints ADD COLUMN visibility TEXT NOT NULL DEFAULT 'published';

-- Idempotency keys, each tied to what its request makes.
CREATE TABLE request_keys (
    seq     INTEGER PRIMARY KEY AUTOINCREMENT,
    key     TEXT NOT NULL UNIQUE,
    subject TEXT NOT NULL
) STRICT;
