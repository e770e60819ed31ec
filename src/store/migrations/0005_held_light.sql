-- What of an environment's light is not drawn as bright as it was: a JSON object, or nothing where all of it is.
ALTER TABLE environments ADD COLUMN held TEXT;
