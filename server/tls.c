#include "server/tls.h"

#include "renderer/log.h"

#include <errno.h>
#include <gnutls/x509.h>
#include <pthread.h>
#include <string.h>
#include <sys/stat.h>

struct credentials {
	gnutls_datum_t cert, key; /* PEM */
	time_t expiry;
};

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static struct credentials in_force;

static void forget(struct credentials *credentials)
{
	if (credentials->key.data)
		gnutls_memset(credentials->key.data, 0, credentials->key.size);
	gnutls_free(credentials->key.data);
	gnutls_free(credentials->cert.data);
	*credentials = (struct credentials){0};
}

static bool read_file(const char *flag, const char *path, gnutls_datum_t *content)
{
	const int error = gnutls_load_file(path, content);
	if (error)
		log_error("%s %s: %s", flag, path, error == GNUTLS_E_FILE_ERROR ? strerror(errno) : gnutls_strerror(error));
	return !error;
}

static void warn_of_readers(const char *path)
{
	struct stat status;
	if (stat(path, &status) == 0 && (status.st_mode & S_IROTH))
		log_warning("--tls-key %s may be read by everybody: chmod o-r", path);
}

/* When the first of the chain ends, which is the daemon's own. */
static time_t expiry_of(const gnutls_datum_t *pem)
{
	gnutls_x509_crt_t *chain = NULL;
	unsigned count = 0;
	time_t expiry = 0;
	if (gnutls_x509_crt_list_import2(&chain, &count, pem, GNUTLS_X509_FMT_PEM, 0) < 0)
		return 0;
	for (unsigned i = 0; i < count; i++) {
		if (i == 0)
			expiry = gnutls_x509_crt_get_expiration_time(chain[i]);
		gnutls_x509_crt_deinit(chain[i]);
	}
	gnutls_free(chain);
	return expiry;
}

/* Does the key belong to the certificate? As a library that would show them sees it. */
static int try(const struct credentials *credentials)
{
	gnutls_certificate_credentials_t trial;
	int error = gnutls_certificate_allocate_credentials(&trial);
	if (error)
		return error;
	error = gnutls_certificate_set_x509_key_mem2(trial, &credentials->cert, &credentials->key, GNUTLS_X509_FMT_PEM, NULL, 0);
	gnutls_certificate_free_credentials(trial);
	return error < 0 ? error : 0;
}

static bool read_credentials(const char *cert_path, const char *key_path, struct credentials *credentials)
{
	*credentials = (struct credentials){0};
	if (!read_file("--tls-cert", cert_path, &credentials->cert) || !read_file("--tls-key", key_path, &credentials->key)) {
		forget(credentials);
		return false;
	}
	const int error = try(credentials);
	if (error) {
		log_error("--tls-cert %s, --tls-key %s: %s", cert_path, key_path, gnutls_strerror(error));
		forget(credentials);
		return false;
	}
	credentials->expiry = expiry_of(&credentials->cert);
	if (credentials->expiry < time(NULL))
		log_warning("--tls-cert %s: the certificate has ended: clients will refuse it", cert_path);
	warn_of_readers(key_path);
	return true;
}

bool tls_check(const char *cert_path, const char *key_path)
{
	struct credentials credentials;
	const bool good = read_credentials(cert_path, key_path, &credentials);
	if (good)
		forget(&credentials);
	return good;
}

bool tls_load(const char *cert_path, const char *key_path)
{
	struct credentials credentials;
	if (!read_credentials(cert_path, key_path, &credentials))
		return false;
	pthread_mutex_lock(&mutex);
	struct credentials old = in_force;
	in_force = credentials;
	pthread_mutex_unlock(&mutex);
	forget(&old);
	log_info("tls: the certificate of %s", cert_path);
	return true;
}

void tls_unload(void)
{
	pthread_mutex_lock(&mutex);
	forget(&in_force);
	pthread_mutex_unlock(&mutex);
}

time_t tls_expiry(void)
{
	pthread_mutex_lock(&mutex);
	const time_t expiry = in_force.expiry;
	pthread_mutex_unlock(&mutex);
	return expiry;
}

/* --- for a connection --------------------------------------------------------------------------------------------------------------- */

enum { CHAIN_MAX = 16 };

static int copy_chain(gnutls_pcert_st **certs, unsigned *count)
{
	gnutls_pcert_st *chain = gnutls_calloc(CHAIN_MAX, sizeof *chain);
	unsigned length = CHAIN_MAX;
	if (!chain)
		return GNUTLS_E_MEMORY_ERROR;
	const int error = gnutls_pcert_list_import_x509_raw(chain, &length, &in_force.cert, GNUTLS_X509_FMT_PEM, 0);
	if (error < 0) {
		gnutls_free(chain);
		return error;
	}
	*certs = chain;
	*count = length;
	return 0;
}

static int copy_key(gnutls_privkey_t *key)
{
	int error = gnutls_privkey_init(key);
	if (error)
		return error;
	error = gnutls_privkey_import_x509_raw(*key, &in_force.key, GNUTLS_X509_FMT_PEM, NULL, 0);
	if (error)
		gnutls_privkey_deinit(*key);
	return error;
}

/* Copies, which GnuTLS frees: the certificate may change before the connection ends. */
int tls_retrieve(gnutls_session_t session, const struct gnutls_cert_retr_st *info, gnutls_pcert_st **certs, unsigned *cert_count,
		 gnutls_ocsp_data_st **ocsp, unsigned *ocsp_count, gnutls_privkey_t *key, unsigned *flags)
{
	(void)session, (void)info;
	pthread_mutex_lock(&mutex);
	int error = copy_chain(certs, cert_count);
	if (!error) {
		error = copy_key(key);
		for (unsigned i = 0; error && i < *cert_count; i++)
			gnutls_pcert_deinit(&(*certs)[i]);
		if (error)
			gnutls_free(*certs);
	}
	pthread_mutex_unlock(&mutex);
	*ocsp = NULL;
	*ocsp_count = 0;
	*flags = GNUTLS_CERT_RETR_DEINIT_ALL;
	return error ? -1 : 0;
}
