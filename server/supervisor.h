/* What a supervisor such as systemd is told of the daemon's life (sd_notify(3), spoken without its library). Main thread. */
#ifndef STRATUS_SERVER_SUPERVISOR_H
#define STRATUS_SERVER_SUPERVISOR_H

/* Sends lines such as "READY=1" to $NOTIFY_SOCKET; nothing without one. A supervisor that does not listen is a warning. */
void supervisor_tell(const char *state);

/* Milliseconds between two "WATCHDOG=1" so that the supervisor is content ($WATCHDOG_USEC, for this process); 0: none are expected. */
int supervisor_interval_ms(void);

#endif
