# hdvplan for any user, with or without a home, from a read-only image; docs/containers.md explains it.
#
#   docker build --tag hdvplan .
#   docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/work" hdvplan plan uturn --vehicle bus
FROM python:3.12-slim

COPY pyproject.toml README.md LICENSE /src/
COPY hdvplan /src/hdvplan
COPY roads /src/roads
RUN pip install --no-cache-dir /src && rm -r /src

# Machine code is made here, by root; those who run the image read it, and nobody needs to write it.
ENV NUMBA_CACHE_DIR=/opt/hdvplan
RUN hdvplan warm-up --quiet

USER 65534:65534
WORKDIR /work
ENTRYPOINT ["hdvplan"]
