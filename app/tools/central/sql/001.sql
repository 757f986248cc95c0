-- Version 1. Run in one transaction by `operator-panel central init` or `upgrade`.
--
-- Each stream has a table: a row is known by (panel, generation, seq); `at` is a part of its key because
-- the tables are partitioned by it. `generation` counts the stores of a cell that began again, as after
-- its disk was replaced: their numbers would else be those of other rows.
--
-- Who writes may only insert, through the tables below and the functions that tell how far a panel's rows
-- are. Partitions are made ahead by the owner (`keep_partitions`), not by who writes: a cell whose clock is
-- wrong would make thousands. A row for which there is no month goes to the default partition, so that no
-- cell is refused, and `keep_partitions` moves it later.

CREATE SCHEMA operator_panel;
REVOKE ALL ON SCHEMA operator_panel FROM PUBLIC;

CREATE TABLE operator_panel.about (
  only_row boolean PRIMARY KEY DEFAULT true CHECK (only_row),
  version integer NOT NULL,
  written_from integer NOT NULL  -- the oldest version whose panels may write
);

CREATE TABLE operator_panel.panel (
  id integer GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  name text NOT NULL,
  site text NOT NULL DEFAULT '',
  key text NOT NULL,             -- the public key that signs the panel's log
  writer name NOT NULL,          -- the role that registered it: no other writes its rows
  since timestamptz NOT NULL DEFAULT now(),
  retired timestamptz
);
CREATE UNIQUE INDEX panel_name ON operator_panel.panel (name) WHERE retired IS NULL;
CREATE UNIQUE INDEX panel_key ON operator_panel.panel (key) WHERE retired IS NULL;

-- The operator's log: the columns of an entry, as it was signed.
CREATE TABLE operator_panel.log (
  panel integer NOT NULL REFERENCES operator_panel.panel, generation integer NOT NULL, seq bigint NOT NULL,
  at timestamptz NOT NULL, at_ms bigint NOT NULL, boot text NOT NULL, monotonic bigint NOT NULL,
  kind text NOT NULL, of bigint, address text NOT NULL, browser text NOT NULL, who text NOT NULL,
  robot text NOT NULL, press text NOT NULL, widget text NOT NULL, action text NOT NULL,
  "values" text NOT NULL, seen text NOT NULL, verdict text NOT NULL, board text NOT NULL,
  outcome text NOT NULL, reason text NOT NULL, text text NOT NULL, prev text NOT NULL, hash text NOT NULL,
  received timestamptz NOT NULL DEFAULT now(),
  PRIMARY KEY (panel, generation, seq, at)
) PARTITION BY RANGE (at);

CREATE TABLE operator_panel.alarm (
  panel integer NOT NULL REFERENCES operator_panel.panel, generation integer NOT NULL, seq bigint NOT NULL,
  at timestamptz NOT NULL, alarm text NOT NULL, robot text NOT NULL, "group" text NOT NULL,
  priority integer NOT NULL, event text NOT NULL, state text NOT NULL, occurrence bigint NOT NULL,
  act text NOT NULL, who text NOT NULL, text text NOT NULL, value double precision,
  "limit" double precision, lasted_s double precision, record text NOT NULL,
  received timestamptz NOT NULL DEFAULT now(),
  PRIMARY KEY (panel, generation, seq, at)
) PARTITION BY RANGE (at);

-- From `at` on a robot was in a state; `recorded` is false where the server did not run.
CREATE TABLE operator_panel.state (
  panel integer NOT NULL REFERENCES operator_panel.panel, generation integer NOT NULL, seq bigint NOT NULL,
  at timestamptz NOT NULL, robot text NOT NULL, state text NOT NULL, shape text NOT NULL,
  colour text NOT NULL, recorded boolean NOT NULL,
  received timestamptz NOT NULL DEFAULT now(),
  PRIMARY KEY (panel, generation, seq, at)
) PARTITION BY RANGE (at);

CREATE TABLE operator_panel.pen (
  panel integer NOT NULL REFERENCES operator_panel.panel, generation integer NOT NULL, number integer NOT NULL,
  robot text NOT NULL, topic text NOT NULL, type text NOT NULL, field text NOT NULL,
  PRIMARY KEY (panel, generation, number)
);

-- A row for each minute and pen. `mean` is of `count` values: the last of each second; after a stop of the
-- forwarder of each 10 s, or of the minute.
CREATE TABLE operator_panel.trend (
  panel integer NOT NULL, generation integer NOT NULL, pen integer NOT NULL, count integer NOT NULL,
  seq bigint NOT NULL, at timestamptz NOT NULL, low double precision NOT NULL,
  high double precision NOT NULL, mean double precision NOT NULL, last double precision NOT NULL,
  PRIMARY KEY (panel, generation, seq, at)
) PARTITION BY RANGE (at);

CREATE TABLE operator_panel.recipe (
  panel integer NOT NULL REFERENCES operator_panel.panel, generation integer NOT NULL, seq bigint NOT NULL,
  at timestamptz NOT NULL, who text NOT NULL, robot text NOT NULL, action text NOT NULL,
  object text NOT NULL, outcome text NOT NULL, reason text NOT NULL, "values" text NOT NULL,
  received timestamptz NOT NULL DEFAULT now(),
  PRIMARY KEY (panel, generation, seq, at)
) PARTITION BY RANGE (at);

-- How a panel is, once a minute. `log_seq` is the last entry of the log that the centre had then.
CREATE TABLE operator_panel.health (
  panel integer NOT NULL REFERENCES operator_panel.panel, generation integer NOT NULL, seq bigint NOT NULL,
  at timestamptz NOT NULL, version text NOT NULL, up_s double precision NOT NULL, cpu_s double precision NOT NULL,
  memory_bytes bigint NOT NULL, disk_free_bytes bigint NOT NULL, data_bytes bigint NOT NULL,
  unsent bigint NOT NULL, lag_s double precision NOT NULL, clock_ahead_s double precision,
  log_generation integer NOT NULL, log_seq bigint NOT NULL,
  received timestamptz NOT NULL DEFAULT now(),
  PRIMARY KEY (panel, generation, seq, at)
) PARTITION BY RANGE (at);

-- Where a generation of a stream begins: the first row, and of the log the hash before it.
CREATE TABLE operator_panel.beginning (
  panel integer NOT NULL REFERENCES operator_panel.panel, stream text NOT NULL, generation integer NOT NULL,
  first bigint NOT NULL, prev text NOT NULL, at timestamptz NOT NULL DEFAULT now(),
  PRIMARY KEY (panel, stream, generation)
);

-- Rows that the cell no longer had when it could send.
CREATE TABLE operator_panel.gap (
  panel integer NOT NULL REFERENCES operator_panel.panel, stream text NOT NULL, generation integer NOT NULL,
  first bigint NOT NULL, last bigint NOT NULL, reason text NOT NULL, at timestamptz NOT NULL DEFAULT now(),
  PRIMARY KEY (panel, stream, generation, first)
);

-- What `operator-panel central prune` removed: all rows up to `upto`; of the log `hash` is of that entry.
CREATE TABLE operator_panel.pruned (
  panel integer NOT NULL REFERENCES operator_panel.panel, stream text NOT NULL, generation integer NOT NULL,
  upto bigint NOT NULL, hash text NOT NULL, at timestamptz NOT NULL DEFAULT now(),
  PRIMARY KEY (panel, stream, generation, upto)
);

CREATE INDEX log_at ON operator_panel.log USING brin (at);
CREATE INDEX alarm_at ON operator_panel.alarm USING brin (at);
CREATE INDEX state_at ON operator_panel.state USING brin (at);
CREATE INDEX trend_at ON operator_panel.trend USING brin (at);
CREATE INDEX recipe_at ON operator_panel.recipe USING brin (at);
CREATE INDEX health_at ON operator_panel.health USING brin (at);
CREATE INDEX log_of_panel ON operator_panel.log (panel, at);
CREATE INDEX alarm_of_panel ON operator_panel.alarm (panel, at);
CREATE INDEX state_of_robot ON operator_panel.state (panel, robot, at);
CREATE INDEX trend_of_pen ON operator_panel.trend (panel, pen, at);
CREATE INDEX health_of_panel ON operator_panel.health (panel, at);

CREATE TABLE operator_panel.log_default PARTITION OF operator_panel.log DEFAULT;
CREATE TABLE operator_panel.alarm_default PARTITION OF operator_panel.alarm DEFAULT;
CREATE TABLE operator_panel.state_default PARTITION OF operator_panel.state DEFAULT;
CREATE TABLE operator_panel.trend_default PARTITION OF operator_panel.trend DEFAULT;
CREATE TABLE operator_panel.recipe_default PARTITION OF operator_panel.recipe DEFAULT;
CREATE TABLE operator_panel.health_default PARTITION OF operator_panel.health DEFAULT;

-- Makes the partitions of the last month, this one and `ahead` more, and those of rows in the default
-- partitions; of rows beyond ten years, whose clock was wrong, none. Returns how many it made.
CREATE FUNCTION operator_panel.keep_partitions(ahead integer DEFAULT 12) RETURNS integer
LANGUAGE plpgsql SET search_path = operator_panel, pg_temp SET timezone = 'UTC' AS $$
DECLARE
  stream text;
  month timestamptz;
  made integer := 0;
  this_month timestamptz := date_trunc('month', now());
BEGIN
  FOREACH stream IN ARRAY ARRAY['log', 'alarm', 'state', 'trend', 'recipe', 'health'] LOOP
    FOR month IN EXECUTE format(
      'SELECT DISTINCT date_trunc(''month'', at) FROM %I WHERE at >= $1 AND at < $2
       UNION SELECT generate_series($3, $4, interval ''1 month'')', stream || '_default')
      USING this_month - interval '10 years', this_month + (ahead + 1) * interval '1 month',
        this_month - interval '1 month', this_month + ahead * interval '1 month'
    LOOP
      IF to_regclass(format('operator_panel.%I', stream || to_char(month, '_YYYY_MM'))) IS NOT NULL THEN
        CONTINUE;
      END IF;
      EXECUTE format('CREATE TEMP TABLE moved ON COMMIT DROP AS SELECT * FROM %I WHERE at >= %L AND at < %L',
        stream || '_default', month, month + interval '1 month');
      EXECUTE format('DELETE FROM %I WHERE at >= %L AND at < %L',
        stream || '_default', month, month + interval '1 month');
      EXECUTE format('CREATE TABLE %I PARTITION OF %I FOR VALUES FROM (%L) TO (%L)',
        stream || to_char(month, '_YYYY_MM'), stream, month, month + interval '1 month');
      EXECUTE format('INSERT INTO %I SELECT * FROM moved', stream);
      DROP TABLE moved;
      made := made + 1;
    END LOOP;
  END LOOP;
  RETURN made;
END $$;

-- A panel's number. Refused: a name that a panel with another key has (OP001), and a key that is known
-- under another name (OP002), as of a copied disk. The lock is held until the connection ends: two
-- programs that send for one panel (OP003) would else send different rows with one number.
CREATE FUNCTION operator_panel.register(panel_name text, panel_site text, panel_key text) RETURNS integer
LANGUAGE plpgsql SECURITY DEFINER SET search_path = operator_panel, pg_temp AS $$
DECLARE
  known panel;
BEGIN
  SELECT * INTO known FROM panel WHERE name = panel_name AND retired IS NULL;
  IF FOUND AND known.key <> panel_key THEN
    RAISE EXCEPTION 'the name is that of another panel' USING ERRCODE = 'OP001', DETAIL = known.key;
  END IF;
  IF NOT FOUND THEN
    SELECT * INTO known FROM panel WHERE key = panel_key AND retired IS NULL;
    IF FOUND THEN
      RAISE EXCEPTION 'the key is that of the panel %', known.name USING ERRCODE = 'OP002', DETAIL = known.name;
    END IF;
    INSERT INTO panel (name, site, key, writer) VALUES (panel_name, panel_site, panel_key, session_user)
      ON CONFLICT DO NOTHING;
    SELECT * INTO STRICT known FROM panel WHERE name = panel_name AND retired IS NULL;
    IF known.key <> panel_key THEN
      RAISE EXCEPTION 'the name is that of another panel' USING ERRCODE = 'OP001', DETAIL = known.key;
    END IF;
  END IF;
  IF known.writer <> session_user THEN
    RAISE EXCEPTION 'the panel is written by the role %', known.writer
      USING ERRCODE = 'OP004', DETAIL = known.writer;
  END IF;
  IF NOT pg_try_advisory_lock(1330662215, known.id) THEN
    RAISE EXCEPTION 'another program sends for this panel' USING ERRCODE = 'OP003';
  END IF;
  UPDATE panel SET site = panel_site WHERE id = known.id AND site <> panel_site;
  RETURN known.id;
END $$;

CREATE FUNCTION operator_panel.is_own(number integer) RETURNS boolean
LANGUAGE sql STABLE SECURITY DEFINER SET search_path = operator_panel, pg_temp AS $$
  SELECT EXISTS (SELECT 1 FROM panel WHERE id = number AND writer = session_user AND retired IS NULL)
$$;

-- How far the rows of a panel are: of each stream that has some, the last one.
CREATE FUNCTION operator_panel.positions(number integer)
RETURNS TABLE (stream text, generation integer, seq bigint, at timestamptz, hash text)
LANGUAGE plpgsql STABLE SECURITY DEFINER SET search_path = operator_panel, pg_temp AS $$
BEGIN
  IF NOT is_own(number) THEN
    RETURN;
  END IF;
  RETURN QUERY
    (SELECT 'log', t.generation, t.seq, t.at, t.hash FROM log t WHERE t.panel = number
      ORDER BY t.generation DESC, t.seq DESC LIMIT 1)
    UNION ALL (SELECT 'alarms', t.generation, t.seq, t.at, '' FROM alarm t WHERE t.panel = number
      ORDER BY t.generation DESC, t.seq DESC LIMIT 1)
    UNION ALL (SELECT 'states', t.generation, t.seq, t.at, '' FROM state t WHERE t.panel = number
      ORDER BY t.generation DESC, t.seq DESC LIMIT 1)
    UNION ALL (SELECT 'trends', t.generation, t.seq, t.at, '' FROM trend t WHERE t.panel = number
      ORDER BY t.generation DESC, t.seq DESC LIMIT 1)
    UNION ALL (SELECT 'recipes', t.generation, t.seq, t.at, '' FROM recipe t WHERE t.panel = number
      ORDER BY t.generation DESC, t.seq DESC LIMIT 1)
    UNION ALL (SELECT 'health', t.generation, t.seq, t.at, '' FROM health t WHERE t.panel = number
      ORDER BY t.generation DESC, t.seq DESC LIMIT 1);
END $$;

-- One row of a panel, to compare it with that of the cell.
CREATE FUNCTION operator_panel.row_mark(number integer, of_stream text, of_generation integer, of_seq bigint)
RETURNS TABLE (at timestamptz, hash text)
LANGUAGE plpgsql STABLE SECURITY DEFINER SET search_path = operator_panel, pg_temp AS $$
DECLARE
  stored text := CASE of_stream WHEN 'log' THEN 'log' WHEN 'alarms' THEN 'alarm' WHEN 'states' THEN 'state'
    WHEN 'trends' THEN 'trend' WHEN 'recipes' THEN 'recipe' WHEN 'health' THEN 'health' END;
BEGIN
  IF is_own(number) AND stored IS NOT NULL THEN
    RETURN QUERY EXECUTE format(
      'SELECT at, %s FROM %I WHERE panel = $1 AND generation = $2 AND seq = $3 LIMIT 1',
      CASE stored WHEN 'log' THEN 'hash' ELSE '''''::text' END, stored)
      USING number, of_generation, of_seq;
  END IF;
END $$;

-- For the owner. A retired panel's name and key are free, for the panel on its replaced PC; its rows stay.
CREATE FUNCTION operator_panel.retire_panel(panel_name text) RETURNS void
LANGUAGE plpgsql SET search_path = operator_panel, pg_temp AS $$
BEGIN
  UPDATE panel SET retired = now() WHERE name = panel_name AND retired IS NULL;
  IF NOT FOUND THEN RAISE EXCEPTION 'there is no panel %', panel_name; END IF;
END $$;

CREATE FUNCTION operator_panel.rename_panel(old_name text, new_name text) RETURNS void
LANGUAGE plpgsql SET search_path = operator_panel, pg_temp AS $$
BEGIN
  UPDATE panel SET name = new_name WHERE name = old_name AND retired IS NULL;
  IF NOT FOUND THEN RAISE EXCEPTION 'there is no panel %', old_name; END IF;
END $$;

REVOKE ALL ON ALL FUNCTIONS IN SCHEMA operator_panel FROM PUBLIC;

-- The roles are of the whole server: another database of it may have made them.
DO $$
BEGIN
  IF NOT EXISTS (SELECT 1 FROM pg_roles WHERE rolname = 'operator_panel_writer') THEN
    CREATE ROLE operator_panel_writer NOLOGIN;
  END IF;
  IF NOT EXISTS (SELECT 1 FROM pg_roles WHERE rolname = 'operator_panel_reader') THEN
    CREATE ROLE operator_panel_reader NOLOGIN;
  END IF;
END $$;

GRANT USAGE ON SCHEMA operator_panel TO operator_panel_writer, operator_panel_reader;
GRANT SELECT ON operator_panel.about TO operator_panel_writer;
GRANT EXECUTE ON FUNCTION operator_panel.register(text, text, text), operator_panel.positions(integer),
  operator_panel.row_mark(integer, text, integer, bigint), operator_panel.is_own(integer)
  TO operator_panel_writer;
GRANT SELECT ON ALL TABLES IN SCHEMA operator_panel TO operator_panel_reader;

-- A role writes rows of its own panels only.
DO $$
DECLARE
  name text;
BEGIN
  FOREACH name IN ARRAY ARRAY['log', 'alarm', 'state', 'pen', 'trend', 'recipe', 'health', 'beginning', 'gap'] LOOP
    EXECUTE format('GRANT INSERT ON operator_panel.%I TO operator_panel_writer', name);
    EXECUTE format('ALTER TABLE operator_panel.%I ENABLE ROW LEVEL SECURITY', name);
    EXECUTE format('CREATE POLICY own ON operator_panel.%I FOR INSERT TO operator_panel_writer '
      'WITH CHECK (operator_panel.is_own(panel))', name);
    EXECUTE format('CREATE POLICY every ON operator_panel.%I FOR SELECT TO operator_panel_reader USING (true)', name);
  END LOOP;
END $$;

INSERT INTO operator_panel.about (version, written_from) VALUES (1, 1);
