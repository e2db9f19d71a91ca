# sh install.sh BENCH.yaml, in a chroot of the guest's disk: wheel, units and CAN interface as docs/service.md says, compiled kernels.
cd /opt/vm
/opt/hil-servo/.venv/bin/python -m pip install --quiet --isolated --no-index --no-deps --force-reinstall ./*.whl
# numba compares the times of sources; a disk image keeps whole seconds
find /opt/hil-servo/.venv/lib/python3.11/site-packages/hil /opt/hil-servo/.venv/lib/python3.11/site-packages/drivers \
    -name '*.py' -exec touch -d @1700000000 {} +
/opt/hil-servo/.venv/bin/hil install-service "$1" --profile move.yaml --cores 0-1
systemd-sysusers
systemctl enable --quiet systemd-networkd
NUMBA_CACHE_DIR=/var/cache/hil /opt/hil-servo/.venv/bin/hil warm-up
chown -R hil:hil /var/cache/hil
