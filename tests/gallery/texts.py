"""The texts of a panel file that the gallery's widgets have, in the three languages shipped."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from app.system.texts import ENGLISH, PanelText


class Words(NamedTuple):
    """One text: `table` as a panel file gives it, `shown` as a page has it."""

    en: str
    ja: str
    de: str

    @property
    def table(self) -> Mapping[str, str]:
        return self._asdict()

    @property
    def shown(self) -> PanelText:
        return PanelText(self._asdict(), ENGLISH)


PRINT: Final = Words("Print label", "ラベル印刷", "Etikett drucken")
START: Final = Words("Start", "起動", "Start")
STOP: Final = Words("Stop", "停止", "Stopp")
RESET: Final = Words("Reset", "リセット", "Rücksetzen")
LIGHT: Final = Words("Light", "照明", "Licht")
FORWARD: Final = Words("forward", "前進", "vorwärts")
PALLET_OUT: Final = Words("Pallet out", "パレット払出し", "Palette ausfahren")
CONVEYOR: Final = Words("Conveyor C3", "コンベヤ C3", "Förderer C3")
CLOSE_DOOR: Final = Words("Close guard door 1", "安全扉 1 を閉じてください", "Schutztür 1 schließen")
TO_AUTOMATIC: Final = Words(
    "Switch to automatic operation", "自動運転に切り替えてください", "Auf Automatikbetrieb schalten"
)
STILL_GRIPS: Final = Words(
    "the gripper still holds a box of the last layer",
    "ハンドが最終段のケースを把持したままです",
    "der Greifer hält noch einen Karton der letzten Lage",
)
BELT_SPEED: Final = Words("Belt speed", "コンベヤ速度", "Bandgeschwindigkeit")
DRIVE: Final = Words("Drive", "走行", "Fahren")
VACUUM: Final = Words("Vacuum", "真空圧", "Vakuum")
GUARD_DOOR: Final = Words("Guard door 1", "安全扉 1", "Schutztür 1")
OPEN: Final = Words("Open", "開", "Offen")
LOCKED: Final = Words("Locked", "施錠", "Verriegelt")
CAMERA: Final = Words("Camera 1", "カメラ 1", "Kamera 1")
PLACES: Final = Words("Places", "場所", "Orte")
CHARGER: Final = Words("Charger", "充電器", "Ladestation")
GATE: Final = Words("Gate 3", "ゲート 3", "Tor 3")
TOUR: Final = Words("Tour", "巡回", "Tour")
HALL: Final = Words("Hall 2", "第 2 ホール", "Halle 2")
ROBOT_LOG: Final = Words("Log of the robot", "ロボットのログ", "Log des Roboters")
AIR_INLET: Final = Words("Air inlet", "エアー元圧", "Eingangsdruck")
JOINTS: Final = Words("Joints", "関節", "Achsen")
DIAGNOSTICS: Final = Words("Diagnostics", "診断", "Diagnose")
LEVEL: Final = Words("Level", "レベル", "Stufe")
PART: Final = Words("Part", "部品", "Teil")
WHAT: Final = Words("Message", "内容", "Meldung")
OK: Final = Words("OK", "正常", "OK")
WARNING: Final = Words("Warning", "警告", "Warnung")
ERROR: Final = Words("Error", "異常", "Fehler")
SPEED: Final = Words("Speed", "速度", "Geschwindigkeit")
PROGRAM: Final = Words("Program", "プログラム", "Programm")
BOXES_COUNT: Final = Words("Boxes", "積付数", "Kartons")
MINUTES_LEFT: Final = Words("{value} min left", "残り {value} 分", "noch {value} min")
LAYER: Final = Words("layer {value} of 6", "{value} / 6 段", "Lage {value} von 6")
CONDITIONS: Final = Words("Conditions", "条件", "Bedingungen")
LOADING: Final = Words("Loading", "ワーク投入", "Einlegen")
OPEN_CLAMP: Final = Words("Open the clamp", "クランプを開く", "Spanner öffnen")
LAY_IN: Final = Words("Lay in the part", "ワークを入れる", "Teil einlegen")
CLOSE_CLAMP: Final = Words("Close the clamp", "クランプを閉じる", "Spanner schließen")
LOOK_IN: Final = Words(
    "Make sure that no one is in the cell",
    "セル内に人がいないことを確認",
    "Prüfen, dass niemand in der Zelle ist",
)
THROUGH_WINDOWS: Final = Words(
    "look through both windows", "両方の窓から確認", "durch beide Fenster sehen"
)
TOUCH_RESET: Final = Words("Touch Reset", "「リセット」に触れる", "Rücksetzen berühren")
BOXES: Final = Words("P12, boxes", "P12、ケース", "P12, Kartons")
ORDER: Final = Words("Order", "製番", "Auftrag")
WRAPPER: Final = Words("Wrapper", "包装機", "Wickler")
PRESSURE: Final = Words("Air pressure, bar", "空気圧（bar）", "Luftdruck, bar")
INLET: Final = Words("Inlet", "元圧", "Eingang")
GRIPPER: Final = Words("Gripper", "ハンド", "Greifer")
TEMPERATURES: Final = Words("Temperatures", "温度", "Temperaturen")
ORDER_NOTE: Final = Words(
    "Order 4711, carton 400 × 300", "製番 4711、ケース 400 × 300", "Auftrag 4711, Karton 400 × 300"
)
PALLETIZING: Final = Words("Palletizing", "パレタイズ", "Palettieren")
RIBBON: Final = Words(
    "Lay in a new ribbon", "新しいリボンをセットしてください", "Neues Farbband einlegen"
)
SETUP: Final = Words("Setup", "段取り", "Einrichten")
BOX: Final = Words("A box", "ケース", "Ein Karton")


def zone(number: int) -> Words:
    """The name of a zone."""
    return Words(f"Zone {number}", f"ゾーン {number}", f"Zone {number}")
