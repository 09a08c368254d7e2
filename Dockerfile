# rotorid as a command: docker build -t rotorid . && docker run --rm -v "$PWD:/data" rotorid verdict flights
FROM python:3.12-slim
WORKDIR /opt/rotorid
COPY pyproject.toml requirements.lock README.md LICENSE ./
COPY src src
COPY acquire acquire
# What the lock pins, of the command and the logs it reads, without what only developers need.
RUN sed 's/ *--hash=[^ ]*//; s/\\$//' requirements.lock | grep -E '^[A-Za-z0-9]' > /tmp/constraints.txt \
    && pip install --no-cache-dir --constraint /tmp/constraints.txt ".[logs]" \
    && useradd --create-home rotorid
USER rotorid
WORKDIR /data
ENTRYPOINT ["rotorid"]
CMD ["--help"]
