"""Changes of recipes: checked against what their author saw, and counted when they are on the disk."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.cell.recipes import book as recipe_book
from app.cell.recipes.book import Author, BookChange, RecipeBook, RecipeDiskError, RecipeFolder
from app.cell.recipes.recipe import (
    MAX_RECIPES,
    MAX_VERSIONS,
    BadRow,
    ReadRow,
    Recipe,
    UnclearRow,
    decoded,
    id_for,
    read_rows,
    recipes_csv,
)
from app.system.errors import InputError
from app.system.texts import Text, render
from tests.cell.recipes.panels import CARTON, TRAY, load_of

pytestmark = pytest.mark.promise("recipes")

ANN, BOB = Author("Ann", 1_700_000_000.0), Author("Bob", 1_700_000_060.0)


@pytest.fixture
def book(tmp_path: Path) -> RecipeBook:
    return RecipeBook(load_of(tmp_path), RecipeFolder(tmp_path / "boxes"))


def write(book: RecipeBook, change: BookChange | Text, author: Author = ANN) -> BookChange:
    """Puts a change on the disk."""
    assert isinstance(change, BookChange), render(change)
    writing = book.begin(author, change)
    writing.run()
    book.end(writing)
    return change


def refused(change: BookChange | Text) -> str:
    assert isinstance(change, Text), change
    return change.code


def made(book: RecipeBook, name: str = "Carton 400 × 300", values: Any = CARTON) -> Recipe:
    return write(book, book.create(ANN, name, values)).puts[0]


def again(book: RecipeBook) -> RecipeBook:
    """The same recipes, read from the disk."""
    other = RecipeBook(book.load, book.folder)
    other.fill(book.folder.read())
    return other


def test_a_recipe_is_read_back_as_it_was_written(book: RecipeBook) -> None:
    carton = made(book, 'Karton "400" \\ 箱')
    write(book, book.save(BOB, carton.id, 1, TRAY))
    for known in (book, again(book)):
        recipe = known.recipes[0]
        assert (recipe.name, recipe.values, recipe.now.number) == ('Karton "400" \\ 箱', TRAY, 2)
        assert [(v.by, v.act) for v in recipe.versions] == [("Ann", "created"), ("Bob", "saved")]
        assert recipe.now.at == BOB.at


def test_the_second_of_two_who_edit_one_recipe_is_told_who_was_first(book: RecipeBook) -> None:
    carton = made(book)
    write(book, book.save(BOB, carton.id, 1, TRAY), BOB)
    change = book.save(ANN, carton.id, 1, {**CARTON, "length": 500})
    assert refused(change) == "recipe_changed_since"
    assert isinstance(change, Text)
    assert "was changed by Bob at" in render(change)
    for act in (book.delete(ANN, carton.id, 1), book.rename(ANN, carton.id, 1, "Other")):
        assert refused(act) == "recipe_changed_since"
    assert book.recipes[0].values == TRAY


def test_a_change_counts_when_it_is_on_the_disk(book: RecipeBook) -> None:
    carton = made(book)
    change = book.save(ANN, carton.id, 1, TRAY)
    assert isinstance(change, BookChange)
    writing = book.begin(ANN, change)
    assert book.recipes[0].values == CARTON
    assert refused(book.save(BOB, carton.id, 1, TRAY)) == "recipe_being_written"
    writing.run()
    book.end(writing)
    assert book.recipes[0].values == TRAY


def test_a_disk_that_refuses_changes_nothing(book: RecipeBook) -> None:
    book.folder.path.write_text("a file where the folder should be")
    change = book.create(ANN, "Carton", CARTON)
    assert isinstance(change, BookChange)
    writing = book.begin(ANN, change)
    with pytest.raises(Exception, match="Not saved"):
        writing.run()
    book.end(writing)
    assert book.recipes == []
    book.folder.path.unlink()
    assert made(book, "Carton").id == "carton"


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ({**CARTON, "length": 700}, "input_outside_limits"),
        ({**CARTON, "length": "400"}, "input_not_a_number"),
        ({**CARTON, "gripper": "hook"}, "input_not_an_option"),
        ({**CARTON, "note": "x" * 11}, "input_text_too_long"),
        ({k: v for k, v in CARTON.items() if k != "fast"}, "recipe_field_missing"),
    ],
)
def test_values_are_checked_by_their_inputs(
    book: RecipeBook, values: dict[str, Any], code: str
) -> None:
    assert refused(book.create(ANN, "Carton", values)) == code
    carton = made(book)
    assert refused(book.save(ANN, carton.id, 1, values)) == code


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("", "recipe_name_empty"),
        ("  ", "recipe_name_empty"),
        ("x" * 61, "recipe_name_too_long"),
        ("a\x00b", "recipe_name_unprintable"),
        ("carton 400  × 300", "recipe_name_taken"),
    ],
)
def test_names_that_can_not_be_given(book: RecipeBook, name: str, code: str) -> None:
    made(book)
    assert refused(book.create(ANN, name, CARTON)) == code


@pytest.mark.parametrize(
    ("name", "made"),
    [
        ("Carton 400 × 300", "carton_400_x_300"),
        ("../../etc/passwd", "etc_passwd"),
        ("/", "recipe"),
        ("箱", "recipe"),
        ("Höhe", "hohe"),
        ("..", "recipe"),
    ],
)
def test_no_path_is_made_of_a_name(name: str, made: str) -> None:
    assert id_for(name, ()) == made
    assert id_for(name, [made]) == f"{made}_2"


def test_history_is_bounded_and_a_version_of_it_is_restored(book: RecipeBook) -> None:
    carton = made(book)
    for n in range(1, MAX_VERSIONS + 5):
        write(book, book.save(ANN, carton.id, n, {**CARTON, "length": 300 + n}))
    recipe = again(book).recipes[0]
    assert len(recipe.versions) == MAX_VERSIONS
    assert refused(book.restore(ANN, carton.id, recipe.now.number, 1)) == "recipe_version_gone"
    change = write(book, book.restore(ANN, carton.id, recipe.now.number, recipe.now.number - 3))
    assert [(d.field, d.new) for d in change.differences] == [("length", 300 + MAX_VERSIONS + 1)]
    assert book.recipes[0].now.act == "restored"


def test_a_set_has_a_limit(book: RecipeBook, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recipe_book, "MAX_RECIPES", 3)
    for n in range(3):
        made(book, f"Recipe {n}")
    assert refused(book.create(ANN, "One more", CARTON)) == "recipe_too_many"


def test_a_deleted_recipe_leaves_its_file_in_the_folder_of_deleted_ones(book: RecipeBook) -> None:
    carton = made(book)
    write(book, book.delete(ANN, carton.id, 1))
    assert book.recipes == again(book).recipes == []
    assert [file.name.split(".")[0] for file in (book.folder.path / "deleted").iterdir()] == [carton.id]


def test_a_csv_changes_recipes_by_their_names_and_refuses_bad_rows(book: RecipeBook) -> None:
    made(book)
    made(book, "Tray", TRAY)
    text = recipes_csv(book.load.fields, book.recipes, {})
    head, carton, tray = text.removeprefix("\ufeff").splitlines()
    assert head.startswith("name,length,speed,gripper,fast,note,version")
    bad = carton.replace("Carton 400 × 300", "Too long").replace(",400,", ",4000,")
    new = tray.replace("Tray", "=New")
    text = "\n".join([head, carton.replace(",400,", ",450,"), tray, bad, new, "Short,1"])
    change = book.take_rows(BOB, read_rows(text, book.load.fields))
    write(book, change, BOB)
    assert (change.changed, change.same, change.created) == (1, 1, 1)
    assert [row.line for row in change.bad] == [4, 6]
    assert "must be 300 to 600 mm" in render(change.bad[0].reason)
    known = {recipe.name: recipe for recipe in again(book).recipes}
    assert {name: r.values["length"] for name, r in known.items()} == {
        "Carton 400 × 300": 450,
        "Tray": 600,
        "=New": 600,
    }
    assert known["Carton 400 × 300"].now.by == "Bob"


def test_what_is_exported_is_imported_as_it_was(book: RecipeBook) -> None:
    made(book, "'+quoted", {**CARTON, "note": '-5,"x"'})
    made(book, "@formula", {**TRAY, "speed": 33.25})
    text = recipes_csv(book.load.fields, book.recipes, {})
    change = book.take_rows(ANN, read_rows(text, book.load.fields))
    assert [render(row.reason) for row in change.bad] == []
    assert (change.same, change.changed, change.created) == (2, 0, 0)


def test_a_spreadsheet_may_separate_by_semicolons(book: RecipeBook) -> None:
    made(book)
    text = recipes_csv(book.load.fields, book.recipes, {}).replace(",", ";").replace("400;80", "450;80")
    change = book.take_rows(ANN, read_rows(text, book.load.fields))
    assert (change.bad, change.changed) == ((), 1)
    comma = text.replace("450;80", '450;"80,5"')  # its header says that it has decimal points
    refusal = book.take_rows(ANN, read_rows(comma, book.load.fields)).bad[0]
    assert "Speed" in render(refusal.reason)
    change = book.take_rows(ANN, read_rows(comma.replace("0.5", "0,5"), book.load.fields))
    assert (change.bad, change.puts[0].values["speed"]) == ((), 80.5)


ROW = 'name;length;speed;gripper;fast;note\nA;{};"{}";vacuum;{};-\n'


@pytest.mark.parametrize(
    ("length", "speed", "head", "decimal", "read"),
    [
        ("400", "12,345", "", "", None),
        ("400", "12.345", "", "", None),
        ("400", "12,345", "0,5", "", 12.345),
        ("400", "12,345", "0.5", "", "Speed"),  # 12345 is outside its limits
        ("400", "12,345", "", ",", 12.345),
        ("400", "12.345", "0.5", "", 12.345),
        ("400", "12,34", "", "", 12.34),
        ("400", "12.34", "", "", 12.34),
        ("400", "12", "", "", 12),
        ("400,0", "12,345", "", "", 12.345),  # the other number says the sign
        ("400.0", "12,34", "", "", None),  # and here they contradict each other
    ],
)
def test_the_decimal_sign_is_said_by_the_file_or_asked_for(
    book: RecipeBook, length: str, speed: str, head: str, decimal: str, read: object
) -> None:
    text = ROW.format(length, speed, "true")
    text = text.replace("note\n", f"note;{head}\n") if head else text
    (row,) = read_rows(text, book.load.fields, decimal)
    if read is None:
        assert isinstance(row, UnclearRow | BadRow)
    if isinstance(read, int | float):
        assert isinstance(row, ReadRow)
        assert row.values["speed"] == read
    if isinstance(read, str):
        assert isinstance(row, BadRow)
        assert read in render(row.reason)


def test_one_unclear_number_of_two_hundred_stops_the_file(book: RecipeBook) -> None:
    head, row, _ = ROW.split("\n")
    rows = [row.format(400, "80", "true").replace("A;", f"R{n};") for n in range(100)]
    text = "\n".join([head, *rows, row.format(400, "80,125", "true")])
    change = book.take_rows(ANN, read_rows(text, book.load.fields))
    assert (change.puts, [row.line for row in change.bad]) == ((), [102])
    (unclear,) = change.bad
    assert isinstance(unclear, UnclearRow)
    assert unclear.written == "80,125"


@pytest.mark.parametrize(
    ("cell", "value"),
    [
        *(("TRUE", True), ("FALSE", False), ("WAHR", True), ("falsch", False), ("1", True)),
        *(("0", False), ("Ein", True), ("Off", False), ("on", True), ("オン", True)),
        *(("x", None), ("2", None)),
    ],
)
def test_a_toggle_is_read_as_spreadsheets_write_it(
    book: RecipeBook, cell: str, value: bool | None
) -> None:
    (row,) = read_rows(ROW.format(400, 80, cell), book.load.fields)
    if value is None:
        assert isinstance(row, BadRow)
        assert "Fast" in render(row.reason)
    else:
        assert isinstance(row, ReadRow)
        assert row.values["fast"] is value


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"], ids=lambda name: str(name)
)
@pytest.mark.parametrize(
    "written",
    [
        ROW,
        "sep=;\r\n" + ROW,
        ROW.replace("note\n", "note;;;\n").replace("-\n", "-;;;\n"),
        ROW.replace("note\n", "note;version;changed_by\n"),
        ROW.replace(";", "\t"),
        ROW + ";;;;;\n",
        ROW.replace("\n", "\r\n"),
    ],
    ids=["plain", "sep", "empty columns", "short rows", "tabs", "an empty row", "CR LF"],
)
def test_a_file_is_read_as_spreadsheets_write_it(book: RecipeBook, encoding: str, written: str) -> None:
    text = written.replace("A", "Höhe").format(400, "80,5", "WAHR")
    rows = list(read_rows(decoded(text.encode(encoding)), book.load.fields))
    (row,) = rows
    assert isinstance(row, ReadRow), render(getattr(row, "reason", ""))
    assert (row.name, row.values["speed"]) == ("Höhe", 80.5)


def test_what_can_not_be_read_is_named(book: RecipeBook) -> None:
    (row,) = read_rows(ROW.replace("A", '"A\nB"').format(400, 80, "true"), book.load.fields)
    assert isinstance(row, ReadRow)  # a line feed in a name counts as a space
    assert (row.line, row.name) == (3, "A B")
    cut, *_ = read_rows(ROW.replace("A;", "A\n;").format(400, 80, "true"), book.load.fields)
    assert isinstance(cut, BadRow)
    assert getattr(cut.reason, "code", "") == "recipe_csv_cells"
    with pytest.raises(InputError, match="save it as CSV in UTF-8"):
        decoded("a".encode("utf-16-le"))
    with pytest.raises(InputError, match="save it as CSV in UTF-8"):
        decoded(b"\x81\xff")


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("", "recipe_csv_column_missing"),
        ("name,length\n", "recipe_csv_column_missing"),
        ("name,length,speed,gripper,fast,note,colour\n", "recipe_csv_column_unknown"),
        ("name,name,length,speed,gripper,fast,note\n", "recipe_csv_column_twice"),
        ('name,length,speed,gripper,fast,note\n"a,1', "recipe_csv_unreadable"),
    ],
)
def test_a_file_that_is_no_such_csv_is_refused_as_a_whole(
    book: RecipeBook, text: str, code: str
) -> None:
    change = book.take_rows(ANN, read_rows(text, book.load.fields))
    assert change.puts == ()
    assert [row.reason.code for row in change.bad if isinstance(row.reason, Text)] == [code]


def test_what_another_process_has_written_in_between_is_not_overwritten(book: RecipeBook) -> None:
    carton = made(book)
    change = book.save(ANN, carton.id, 1, TRAY)
    assert isinstance(change, BookChange)
    writing = book.begin(ANN, change)
    other = again(book)
    write(other, other.save(BOB, carton.id, 1, {**CARTON, "note": "Bob"}), BOB)
    with pytest.raises(RecipeDiskError) as refusal:
        writing.run()
    assert refusal.value.reason.code == "recipe_changed_since"
    book.end(writing)
    assert again(book).recipes[0].values["note"] == "Bob"


def test_the_second_of_two_who_give_one_name_is_told(book: RecipeBook) -> None:
    first = book.create(ANN, "Carton", CARTON)
    assert isinstance(first, BookChange)
    writing = book.begin(ANN, first)
    assert refused(book.create(BOB, "carton", TRAY)) == "recipe_name_taken"
    rows = read_rows(recipes_csv(book.load.fields, first.puts, {}), book.load.fields)
    imported = book.take_rows(BOB, rows)
    assert [row.reason.code for row in imported.bad if isinstance(row.reason, Text)] == [
        "recipe_being_written"
    ]
    writing.run()
    book.end(writing)
    assert refused(book.create(BOB, "CARTON", TRAY)) == "recipe_name_taken"
    assert [recipe.name for recipe in again(book).recipes] == ["Carton"]


def test_a_name_that_is_being_given_is_taken(book: RecipeBook) -> None:
    carton, tray = made(book, "Carton"), made(book, "Tray")
    renamed = book.rename(ANN, carton.id, 1, "Box")
    assert isinstance(renamed, BookChange)
    writing = book.begin(ANN, renamed)
    assert refused(book.rename(BOB, tray.id, 1, "box")) == "recipe_name_taken"
    assert refused(book.create(BOB, "Box", TRAY)) == "recipe_name_taken"
    writing.run()
    book.end(writing)
    write(book, book.create(BOB, "Carton", TRAY), BOB)


def test_a_name_that_another_process_has_given_is_not_given_twice(book: RecipeBook) -> None:
    other = again(book)
    change = book.create(ANN, "Carton!", CARTON)
    assert isinstance(change, BookChange)
    taken = other.create(BOB, "Tray", TRAY)
    write(other, taken, BOB)
    write(other, other.rename(BOB, other.recipes[0].id, 1, "CARTON!"), BOB)
    writing = book.begin(ANN, change)
    with pytest.raises(RecipeDiskError) as refusal:
        writing.run()
    assert refusal.value.reason.code == "recipe_name_taken"
    assert [recipe.name for recipe in again(book).recipes] == ["CARTON!"]


def test_a_row_changes_no_recipe_where_several_have_its_name(book: RecipeBook) -> None:
    made(book, "Carton")
    twin = book.recipes[0]
    book.folder.write(replace(twin, id="twin"))
    both = again(book)
    rows = read_rows(
        recipes_csv(book.load.fields, [twin], {}).replace("Carton", "carton"), book.load.fields
    )
    change = both.take_rows(ANN, rows)
    assert change.puts == ()
    assert [row.reason.code for row in change.bad if isinstance(row.reason, Text)] == [
        "recipe_csv_name_twice"
    ]


def test_every_row_beyond_the_limit_is_counted(book: RecipeBook) -> None:
    recipe = made(book)
    head, row = recipes_csv(book.load.fields, [recipe], {}).splitlines()
    rows = [row.replace(recipe.name, f"Carton {number}") for number in range(800)]
    change = book.take_rows(ANN, read_rows("\n".join([head, *rows]), book.load.fields))
    assert (change.created, len(change.bad)) == (MAX_RECIPES - 1, 800 - MAX_RECIPES + 1)
