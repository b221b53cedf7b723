# docker build -t scenewright .
# docker run --rm -v "$PWD/outputs:/outputs" scenewright demo --out /outputs/demo
FROM debian:bookworm-slim
RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates make
WORKDIR /opt/scenewright
COPY . .
RUN make setup
ENV PATH="/opt/scenewright/.venv/bin:$PATH"
ENTRYPOINT ["scenewright"]
