-- What the stages of a job that has ended took: a JSON list.
ALTER TABLE jobs ADD COLUMN stages TEXT;
