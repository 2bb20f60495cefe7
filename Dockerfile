# hdvplan for any user, with or without a home, from a read-only image; docs/containers.md explains it.
#
#   docker build --tag hdvplan .
#   docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/work" hdvplan plan uturn --vehicle bus
FROM python:3.12-slim

COPY pyproject.toml hatch_build.py README.md LICENSE /src/
COPY hdvplan /src/hdvplan
COPY roads /src/roads
RUN pip install --no-cache-dir "/src[study]" && rm -r /src

USER 65534:65534
WORKDIR /work
ENTRYPOINT ["hdvplan"]
