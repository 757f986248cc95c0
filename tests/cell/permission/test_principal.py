"""Who presses: a client now, a user there once users log in."""

from app.cell.permission.control import ControlAuthority
from app.panel.rules import ControlRules
from app.records.press_record import origin_of
from app.records.principal import Clients, Principal

CLIENT = Clients().identify("1" * 32, "192.0.2.1")


def test_without_users_a_principal_is_its_client() -> None:
    who = Principal(CLIENT)
    assert who.user == ""
    assert (who.name, who.title, str(who)) == (CLIENT.name, CLIENT.title, str(CLIENT))


def test_the_log_and_the_control_authority_name_the_user() -> None:
    who = Principal(CLIENT, "Kim")
    origin = origin_of(who, "ab-1")
    assert (origin.who, origin.browser, origin.address) == ("Kim", CLIENT.id, "192.0.2.1")
    control = ControlAuthority(ControlRules(required=True), "Robot 1")
    assert control.take(who) == ""
    assert control.view()["holder_name"] == "Kim"
    assert control.view()["holder"] == CLIENT.id


def test_another_user_of_the_same_client_has_the_clients_control() -> None:
    """Control belongs to the client: it is the one screen that a robot is operated from."""
    control = ControlAuthority(ControlRules(required=True), "")
    control.take(Principal(CLIENT, "Kim"))
    assert control.verdict(Principal(CLIENT, "Lee")).permitted
