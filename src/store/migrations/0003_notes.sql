-- Numbers worked out of a paint's file once, by which lists are ordered. They can be worked out again.
CREATE TABLE notes (
    paint   TEXT NOT NULL,
    kind    TEXT NOT NULL,
    numbers TEXT NOT NULL,
    PRIMARY KEY (paint, kind)
) STRICT, WITHOUT ROWID;
