# The service in one image. PyTorch's default wheel for Linux carries gigabytes of CUDA libraries that nothing here
# needs: give the address of PyTorch's index of CPU wheels (its installation page has it), or of a mirror.
#   docker compose -f .deploy/one-machine.yaml up --build
# or, step by step:
#   docker build --build-arg TORCH_INDEX=ADDRESS -t uav-allocator .
#   docker run --rm -v allocator-data:/data uav-allocator python -m app keys create --role library --name me
#   docker run --rm -p 8000:8000 -v allocator-data:/data uav-allocator
# For more than one machine give the extras too, --build-arg EXTRAS=[postgres,ray]; .deploy/compose.yaml does.
FROM python:3.11-slim

ARG TORCH_INDEX=
ARG EXTRAS=

# Compiled code runs on processors that have what this name says (x86-64-v3: AVX2, since about 2015), wherever the
# image was built. Measured on an AMD EPYC (znver3) with bench_local_search.py: as fast as code for that kind alone.
ARG CPU=x86-64-v3

ENV PIP_NO_CACHE_DIR=1 \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    NUMBA_CACHE_DIR=/srv/numba-cache \
    NUMBA_CPU_NAME=$CPU \
    NUMBA_CPU_FEATURES= \
    ALLOCATOR_HOST=0.0.0.0 \
    ALLOCATOR_DATA_DIR=/data

WORKDIR /srv/allocator
# What it needs comes before its code, beside an empty package, so that a change of the code installs little anew.
COPY pyproject.toml constraints.txt LICENSE .deploy/shrink ./
RUN mkdir app policy_store \
    && touch README.md policy_store/__init__.py \
    && echo '__version__ = "0"' > app/__init__.py \
    && pip install ${TORCH_INDEX:+--index-url "$TORCH_INDEX"} "$(grep '^torch==' constraints.txt)" \
    && ./shrink python \
    && pip install --constraint constraints.txt ".$EXTRAS"
COPY README.md ./
COPY app ./app
COPY policy_store ./policy_store
RUN pip install --no-deps .

# The compiled code is made here, as the user that runs it, so that no first answer waits for a compiler.
RUN useradd --create-home --uid 1000 allocator \
    && mkdir -p /data /srv/numba-cache \
    && chown allocator /data /srv/numba-cache
USER allocator
WORKDIR /data
RUN python -m app compile

VOLUME /data
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=3s --start-period=60s \
    CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/healthz', timeout=2)"]
CMD ["python", "-m", "app", "serve"]
