"""``python -m app``: see :mod:`app.cli`."""

from app.cli import application

if __name__ == "__main__":
    application()
