"""The application with short catalogues of German and Japanese, in place of those of the project."""

from pathlib import Path

from tests.support.catalogues import app_with, write_catalogue

GERMAN = {
    "published": "Gesendet auf {topic} um {time}.",
    "press_no_subscriber": "Gesendet auf {topic} um {time}, aber kein Node empfängt es.",
    "refused": "Nicht gesendet um {time}: {why}",
    "input_outside_limits": "{label} ist {given}: erlaubt ist {limits}",
    "input_not_a_number": "{label} muss eine Zahl sein, {limits}, wie {example}, nicht {given}",
    "limits_both": "{low} bis {high}{unit}",
    "limits": "{low} bis {high}{unit}, in Schritten von {step}",
    "interlock_not_permitted": "Der Roboter erlaubt {name} nicht.",
    "interlock_waiting": "Gesperrt: warte auf {topic}.",
    "keypad_decimal": ",",
    "display_language": "Sprache",
    "log_page_title": "Bedienprotokoll",
    "log_outcome_refused": "abgelehnt",
    "browser_unknown": "ein Programm",
    "browser_local": "das Panel an der Zelle",
    "browser_more": "Browser {number} an der Zelle",
}
JAPANESE = {
    "published": "{time} に {topic} へ送信しました。",
    "press_no_subscriber": "{time} に {topic} へ送信しましたが、受信するノードがありません。",
    "refused": "{time} 送信していません：{why}",
    "input_outside_limits": "{label}は{given}です。{limits}でなければなりません",
    "limits_both": "{low}～{high}{unit}",
    "interlock_not_permitted": "ロボットが「{name}」を許可していません。",
    "display_language": "言語",
    "log_page_title": "操作ログ",
    "between_names": "、",
}


def written(folder: Path) -> None:
    write_catalogue(folder, "de", GERMAN)
    write_catalogue(folder, "ja", JAPANESE)


app = app_with(written)
