"""Forms in which secrets are written: none of them may leave a machine."""

from typing import Final

SECRET: Final = "swordfish"
NUMBER: Final = "7391746"  # a PIN
_PEM: Final = "PRIVATE KEY"
FORMS: Final = tuple(
    form.replace("@@", SECRET).replace("##", NUMBER)
    for form in (
        "password=@@",
        "password = @@",
        'password = "@@"',
        "password: '@@'",
        '{"password":"@@"}',
        '{"password": ["x", ["@@"]]}',
        "passwd @@",
        "passphrase: @@",
        "pwd=@@;Server=db",
        "--password=@@",
        "--password @@",
        "-p@@",
        "?token=@@",
        "&access_token=@@&x=1",
        "#password=@@",
        "tls/robot:7447#password=@@",
        "tcp/robot:7447?token=@@",
        "https://user:@@@robot/path",
        "https://@@@robot",
        "env: TOKEN=@@",
        "environment: [TOKEN=@@]",
        "export PGPASSWORD=@@",
        "PGPASSWORD=@@",
        "MYSQL_PWD=@@",
        "AWS_SECRET_ACCESS_KEY=@@",
        "apiKey: @@",
        "apikey=@@",
        "x-api-key: @@",
        "psk=@@",
        "wpa_passphrase @@",
        "pin = ##",
        "pin: ##",
        "PIN ##",
        "the code is ## today",
        "Authorization: Bearer @@",
        "Authorization: Basic @@",
        "Cookie: session=@@",
        "Set-Cookie: a=@@; HttpOnly",
        "client_secret @@",
        "[[secret], [@@]]",
        "{ auth: { usrpwd: { user: 'u', password: '@@' } } }",
        f"-----BEGIN {_PEM}----- @@ -----END {_PEM}-----",
        "ssh-rsa AAAA@@ user@host",
        "eyJhbGciOi.@@.x",
        "<password>@@</password>",
        "// @@",
        "/* @@ */",
        "# @@",
        '"@@',
        "'@@",
        "`@@`",
        "@@",
        "%40@@%40",
        'it said \\"@@\\"',
        "[INFO] [1.0] [web_ui]: bridge @@ found",
        "Started @@ - @@.",
        '  File "/x/app/@@.py", line 3, in @@',
        "@@Error: @@",
        "press 0123456789abcdef of @@ by @@",
    )
)


def secrets_in(files: dict[str, str]) -> list[tuple[str, str]]:
    """(file, what is around it) of each secret."""
    leaks = []
    for name, text in files.items():
        lower = f"{name}\n{text}".lower()
        for secret in (SECRET, NUMBER):
            if (at := lower.find(secret)) >= 0:
                leaks.append((name, lower[max(0, at - 60) : at + 60]))
    return leaks
