# syntax=docker/dockerfile:1
# docker build -t stratus .          docker run -p 127.0.0.1:8080:8080 stratus          (GPU: --gpus all)
# The first stage has compilers and makes the Mie kernel table; the second holds what runs.

FROM debian:12-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends make && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY Makefile ./
COPY scripts scripts
RUN make packages && rm -rf /var/lib/apt/lists/*
COPY . .
RUN make -j"$(nproc)" programs && make install DESTDIR=/out PREFIX=/usr/local \
	&& strip /out/usr/local/bin/* /out/usr/local/lib/stratus/*.so

FROM debian:12-slim
# libegl1 is libglvnd's: it finds NVIDIA's EGL where the container runtime brings it, else Mesa's.
RUN apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
		libepoxy0 libopengl0 libegl1 libegl-mesa0 libgl1-mesa-dri libopenimageio2.4 zlib1g \
		libmicrohttpd12 libgnutls30 libjansson4 libnova-0.16-0 libnettle8 libxxhash0 libcminpack1 libcurl4 libpng16-16 libopenexr-3-1-30 ca-certificates \
	&& rm -rf /var/lib/apt/lists/* \
	&& useradd --uid 10001 --user-group --no-create-home --home-dir /nonexistent --shell /usr/sbin/nologin stratus \
	&& install -d -o stratus -g stratus /var/lib/stratus
COPY --from=build /out/usr/local/ /usr/local/
COPY --from=build /src/LICENSE /usr/share/doc/stratus/

ARG VERSION=0.4.0
ARG REVISION=
ARG CREATED=
LABEL org.opencontainers.image.title="stratus" \
	org.opencontainers.image.description="Renders physically based cloudy skies on request, over HTTP" \
	org.opencontainers.image.version="${VERSION}" \
	org.opencontainers.image.revision="${REVISION}" \
	org.opencontainers.image.created="${CREATED}" \
	org.opencontainers.image.licenses="Apache-2.0" \
	org.opencontainers.image.base.name="docker.io/library/debian:12-slim"

# The container has a network of its own: who comes in is decided where its port is published.
ENV STRATUS_LISTEN=0.0.0.0:8080 \
	STRATUS_ALLOW_ANYONE=1 \
	STRATUS_STATE_DIR=/var/lib/stratus \
	STRATUS_LOG_FORMAT=json \
	NVIDIA_DRIVER_CAPABILITIES=graphics,compute,utility
USER 10001:10001
VOLUME /var/lib/stratus
EXPOSE 8080
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=30s --timeout=8s --start-period=60s CMD ["stratus", "health", "--quiet"]
CMD ["stratusd"]
