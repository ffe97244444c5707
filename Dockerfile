# The command `snell` in a small image:
#
#   docker build -t snell .
#   docker run --rm -v "$PWD:/work" snell render cornell-box
FROM rust:1-slim-bookworm AS build
RUN apt-get update && apt-get install -y --no-install-recommends g++ \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /source
COPY . .
RUN cargo build --release --locked --package snell && strip target/release/snell

FROM debian:bookworm-slim
COPY --from=build /source/target/release/snell /usr/local/bin/snell
COPY --from=build /source/LICENSE-MIT /source/LICENSE-APACHE /source/THIRD_PARTY.md \
    /usr/share/doc/snell/
RUN useradd --create-home snell
USER snell
WORKDIR /work
ENTRYPOINT ["snell"]
