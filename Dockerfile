# The service in one image. PyTorch's default wheel for Linux carries gigabytes of CUDA libraries that nothing here
# needs: give the address of PyTorch's index of CPU wheels (its installation page has it), or of a mirror.
#   docker build --build-arg TORCH_INDEX=ADDRESS -t uav-allocator .
#   docker run --rm -v allocator-data:/data uav-allocator python -m app keys create --role library --name me
#   docker run --rm -p 8000:8000 -v allocator-data:/data uav-allocator
# For more than one machine give the extras too, --build-arg EXTRAS=[postgres,ray]; .deploy/ has a compose file.
FROM python:3.11-slim

ARG TORCH_INDEX=
ARG EXTRAS=

ENV PIP_NO_CACHE_DIR=1 \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    NUMBA_CACHE_DIR=/srv/numba-cache \
    ALLOCATOR_HOST=0.0.0.0 \
    ALLOCATOR_DATA_DIR=/data

WORKDIR /srv/allocator
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY app ./app
COPY policy_store ./policy_store
RUN pip install ${TORCH_INDEX:+--index-url "$TORCH_INDEX"} "$(grep '^torch==' constraints.txt)" \
    && pip install --constraint constraints.txt ".$EXTRAS"

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
