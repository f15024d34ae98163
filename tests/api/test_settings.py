"""Settings: each documented, read from the environment by its name, refused when it makes no sense."""

import re
from pathlib import Path

import pytest
from pydantic import ValidationError

from app.settings import Settings

ROOT = Path(__file__).parents[2]


def documented(default):
    if default in (None, "", (), {}):
        return "–"
    return f"`{str(default).lower() if isinstance(default, bool) else default}`"


def test_every_setting_is_documented_with_its_default():
    page = (ROOT / "app" / "SETTINGS.md").read_text("utf-8")
    rows = re.findall(r"^\| `(ALLOCATOR_\w+)` \| (.+?) \|", page, re.MULTILINE)
    fields = Settings.model_fields.items()
    defaults = {name: documented(field.get_default(call_default_factory=True)) for name, field in fields}
    defaults["workers"] = "number of CPUs"

    assert len(rows) == len(defaults)
    assert dict(rows) == {f"ALLOCATOR_{name.upper()}": default for name, default in defaults.items()}


def test_environment_sets_them(monkeypatch, tmp_path):
    monkeypatch.setenv("ALLOCATOR_DATA_DIR", str(tmp_path))
    monkeypatch.setenv("ALLOCATOR_PORT", "1234")
    settings = Settings()

    assert settings.port == 1234
    assert settings.resolved_database_url == f"sqlite:///{tmp_path}/allocator.sqlite3"


def test_database_url_comes_before_the_data_folder(tmp_path):
    settings = Settings(data_dir=tmp_path, database_url="sqlite:////elsewhere/x.db")

    assert settings.resolved_database_url == "sqlite:////elsewhere/x.db"


@pytest.mark.parametrize(
    ("name", "value"),
    [("workers", 0), ("port", 65_536), ("max_uavs", 0), ("job_grace_s", -1), ("job_grace_s", "nan")],
)
def test_nonsense_is_refused(name, value):
    with pytest.raises(ValidationError):
        Settings(**{name: value})


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("trusted_proxies", "192.0.2.1, proxy.example", "'proxy.example' is no address or network"),
        ("cors_origins", "maps.example", "'maps.example' is no origin"),
        ("cors_origins", "https://maps.example/page", "'https://maps.example/page' is no origin"),
        ("allowed_hosts", "https://relief.example", "'https://relief.example' is no name of a host"),
        ("allowed_hosts", "relief.example:8000", "'relief.example:8000' is no name of a host"),
        ("ray_resources", "{", "is no JSON"),
    ],
)
def test_what_would_never_match_is_refused(monkeypatch, name, value, says):
    monkeypatch.setenv(f"ALLOCATOR_{name.upper()}", value)
    with pytest.raises(ValidationError, match=re.escape(says)):
        Settings()


def test_names_addresses_and_networks_are_taken(monkeypatch):
    for name, value in {
        "TRUSTED_PROXIES": "192.0.2.1,2001:db8::/32",
        "CORS_ORIGINS": "https://maps.example:8000,http://localhost",
        "ALLOWED_HOSTS": "relief.example,[::1]",
        "RAY_RESOURCES": '{"CPU": 2}',
    }.items():
        monkeypatch.setenv(f"ALLOCATOR_{name}", value)
    settings = Settings()
    assert settings.trusted_proxies == ("192.0.2.1", "2001:db8::/32")
    assert settings.ray_resources == {"CPU": 2.0}


def test_null_keeps_jobs_for_ever(monkeypatch):
    assert Settings().job_retention_s == 30 * 86_400
    monkeypatch.setenv("ALLOCATOR_JOB_RETENTION_DAYS", "null")

    assert Settings().job_retention_s is None
