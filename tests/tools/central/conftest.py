"""A real PostgreSQL with the schema of the centre."""

from collections.abc import Iterator

import pytest

from app.tools.central.schema import database, upgrade
from tests.support.postgres import READER, SCHEMA, WRITER, Cluster, add_logins, cluster, new_database


@pytest.fixture(scope="session")
def postgres() -> Iterator[Cluster]:
    """A cluster with two cells and a dashboard that may sign in; the database `SCHEMA` has the
    schema."""
    with cluster() as server:
        new_database(server, SCHEMA)
        with database(server.config(database=SCHEMA)) as db:
            upgrade(db, new=True)
        add_logins(server, cell1=WRITER, cell2=WRITER, grafana=READER)
        yield server


@pytest.fixture
def centre(postgres: Cluster) -> Cluster:
    """With the schema in the plant's database, which is new."""
    new_database(postgres, template=SCHEMA)
    return postgres
