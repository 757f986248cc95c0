-- Version 2. Details of trends: the seconds of a time span stay in the cell, until someone asks for them.
-- A request is a row that the cell's forwarder reads, because nothing connects into a cell. Panels of
-- version 1 go on writing, and answer no request.

CREATE TABLE operator_panel.detail_request (
  id integer GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  panel integer NOT NULL REFERENCES operator_panel.panel,
  pens text[] NOT NULL,          -- topics, or topics with a field ('/speed data'); none: all pens
  since timestamptz NOT NULL,
  until timestamptz NOT NULL,
  asked_by name NOT NULL,
  asked_at timestamptz NOT NULL DEFAULT now(),
  status text NOT NULL DEFAULT 'open' CHECK (status IN ('open', 'done', 'refused')),
  reason text NOT NULL DEFAULT '',
  rows bigint NOT NULL DEFAULT 0,
  settled_at timestamptz
);
CREATE INDEX detail_request_open ON operator_panel.detail_request (panel) WHERE status = 'open';

-- The values of `width` seconds from `at` on. A pen is that of the first generation with its names.
CREATE TABLE operator_panel.trend_detail (
  panel integer NOT NULL, generation integer NOT NULL, pen integer NOT NULL, width integer NOT NULL,
  at timestamptz NOT NULL, low double precision NOT NULL, high double precision NOT NULL,
  last double precision NOT NULL,
  PRIMARY KEY (panel, generation, pen, at, width)
) PARTITION BY RANGE (at);
CREATE INDEX trend_detail_at ON operator_panel.trend_detail USING brin (at);
CREATE TABLE operator_panel.trend_detail_default PARTITION OF operator_panel.trend_detail DEFAULT;

-- As in version 1, for each table that is partitioned.
CREATE OR REPLACE FUNCTION operator_panel.keep_partitions(ahead integer DEFAULT 12) RETURNS integer
LANGUAGE plpgsql SET search_path = operator_panel, pg_temp SET timezone = 'UTC' AS $$
DECLARE
  stream text;
  month timestamptz;
  made integer := 0;
  this_month timestamptz := date_trunc('month', now());
BEGIN
  FOR stream IN SELECT relname FROM pg_class
    WHERE relnamespace = 'operator_panel'::regnamespace AND relkind = 'p' ORDER BY relname
  LOOP
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

-- Asks a panel for details; returns the number of the request. Refused (OP005) is what no cell answers,
-- and more than ten open requests of a panel.
CREATE FUNCTION operator_panel.ask_details(
  panel_name text, request_pens text[], request_since timestamptz, request_until timestamptz
) RETURNS integer
LANGUAGE plpgsql SECURITY DEFINER SET search_path = operator_panel, pg_temp AS $$
DECLARE
  asked integer;
  wrong text;
  made integer;
BEGIN
  SELECT id INTO asked FROM panel WHERE name = panel_name AND retired IS NULL FOR SHARE;
  IF NOT FOUND THEN
    RAISE EXCEPTION 'there is no panel "%" at the centre', panel_name USING ERRCODE = 'OP005';
  END IF;
  IF NOT isfinite(request_since) OR NOT isfinite(request_until) OR request_since >= request_until THEN
    RAISE EXCEPTION 'the time span ends before it begins' USING ERRCODE = 'OP005';
  END IF;
  IF request_until > now() THEN
    RAISE EXCEPTION 'the time span is not over yet' USING ERRCODE = 'OP005';
  END IF;
  IF request_until - request_since > interval '7 days' THEN
    RAISE EXCEPTION 'the time span is longer than 7 days' USING ERRCODE = 'OP005';
  END IF;
  SELECT name INTO wrong FROM unnest(request_pens) AS name WHERE NOT EXISTS (
    SELECT 1 FROM pen p WHERE p.panel = asked AND name IN (p.topic, p.topic || ' ' || p.field)) LIMIT 1;
  IF FOUND THEN
    RAISE EXCEPTION 'the panel "%" has no pen "%": it has %', panel_name, wrong, coalesce(
      (SELECT string_agg(DISTINCT format('"%s %s"', p.topic, p.field), ', ') FROM pen p
        WHERE p.panel = asked), 'none') USING ERRCODE = 'OP005';
  END IF;
  PERFORM pg_advisory_xact_lock(1330662217, asked);
  IF (SELECT count(*) FROM detail_request r WHERE r.panel = asked AND r.status = 'open') >= 10 THEN
    RAISE EXCEPTION 'the panel "%" has ten open requests: wait for them', panel_name
      USING ERRCODE = 'OP005';
  END IF;
  INSERT INTO detail_request (panel, pens, since, until, asked_by)
    VALUES (asked, request_pens, request_since, request_until, session_user) RETURNING id INTO made;
  RETURN made;
END $$;

-- For a panel: its open requests, the oldest first.
CREATE FUNCTION operator_panel.open_requests(number integer)
RETURNS TABLE (id integer, pens text[], since timestamptz, until timestamptz, asked_by name)
LANGUAGE sql STABLE SECURITY DEFINER SET search_path = operator_panel, pg_temp AS $$
  SELECT r.id, r.pens, r.since, r.until, r.asked_by FROM detail_request r
  WHERE r.panel = number AND r.status = 'open' AND is_own(number) ORDER BY r.id
$$;

-- For a panel: the pens that the centre has of it, each of the first generation with its names.
CREATE FUNCTION operator_panel.known_pens(panel_number integer)
RETURNS TABLE (robot text, topic text, type text, field text, generation integer, number integer)
LANGUAGE sql STABLE SECURITY DEFINER SET search_path = operator_panel, pg_temp AS $$
  SELECT DISTINCT ON (p.robot, p.topic, p.type, p.field)
    p.robot, p.topic, p.type, p.field, p.generation, p.number FROM pen p
  WHERE p.panel = panel_number AND is_own(panel_number)
  ORDER BY p.robot, p.topic, p.type, p.field, p.generation, p.number
$$;

-- For a panel: the end of a request.
CREATE FUNCTION operator_panel.settle_request(
  panel_number integer, request integer, new_status text, new_reason text, sent bigint
) RETURNS void
LANGUAGE sql SECURITY DEFINER SET search_path = operator_panel, pg_temp AS $$
  UPDATE detail_request SET status = new_status, reason = new_reason, rows = sent, settled_at = now()
  WHERE id = request AND panel = panel_number AND status = 'open' AND is_own(panel_number)
$$;

REVOKE ALL ON FUNCTION operator_panel.ask_details(text, text[], timestamptz, timestamptz),
  operator_panel.open_requests(integer), operator_panel.known_pens(integer),
  operator_panel.settle_request(integer, integer, text, text, bigint) FROM PUBLIC;

-- Who may ask may also read.
DO $$
BEGIN
  IF NOT EXISTS (SELECT 1 FROM pg_roles WHERE rolname = 'operator_panel_asker') THEN
    CREATE ROLE operator_panel_asker NOLOGIN;
  END IF;
END $$;
GRANT operator_panel_reader TO operator_panel_asker;
GRANT EXECUTE ON FUNCTION operator_panel.ask_details(text, text[], timestamptz, timestamptz)
  TO operator_panel_asker;
GRANT EXECUTE ON FUNCTION operator_panel.open_requests(integer), operator_panel.known_pens(integer),
  operator_panel.settle_request(integer, integer, text, text, bigint) TO operator_panel_writer;
GRANT SELECT ON operator_panel.detail_request, operator_panel.trend_detail TO operator_panel_reader;
GRANT INSERT ON operator_panel.trend_detail TO operator_panel_writer;
ALTER TABLE operator_panel.trend_detail ENABLE ROW LEVEL SECURITY;
CREATE POLICY own ON operator_panel.trend_detail FOR INSERT TO operator_panel_writer
  WITH CHECK (operator_panel.is_own(panel));
CREATE POLICY every ON operator_panel.trend_detail FOR SELECT TO operator_panel_reader USING (true);

UPDATE operator_panel.about SET version = 2;
