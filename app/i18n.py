"""`python -m app.i18n`: checks the catalogues of sentences, as `app.system.texts.check` says."""

import sys

from app.system.texts.check import main

if __name__ == "__main__":
    sys.exit(main())
