/* The certificate that the daemon shows, by GnuTLS. One for the process, since GnuTLS hands nothing along to those that it asks for one. */
#ifndef STRATUS_SERVER_TLS_H
#define STRATUS_SERVER_TLS_H

#include <gnutls/abstract.h>
#include <gnutls/gnutls.h>
#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>
#include <time.h>

/* TLS 1.2 and 1.3 with forward secrecy; nothing older. */
#define TLS_PRIORITIES "SECURE128:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2:-RSA:%SERVER_PRECEDENCE"

/* Reads a certificate, with its chain, and its private key, both PEM; they are shown from the next connection on, and connections that
 * exist go on. false (and a line of the log) when they cannot be used: what was there before stays then. Main thread. */
bool tls_load(const char *cert_path, const char *key_path);

/* Likewise, without putting them in force. */
bool tls_check(const char *cert_path, const char *key_path);

/* Forgets them. No connection exists. */
void tls_unload(void);

/* When the certificate ends; 0: there is none. Any thread. */
time_t tls_expiry(void);

/* Hands a copy of the certificate to GnuTLS (gnutls_certificate_retrieve_function3). */
int tls_retrieve(gnutls_session_t session, const struct gnutls_cert_retr_st *info, gnutls_pcert_st **certs, unsigned *cert_count,
		 gnutls_ocsp_data_st **ocsp, unsigned *ocsp_count, gnutls_privkey_t *key, unsigned *flags);

#endif
