#include "server/sandbox.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <stddef.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

/* AddressSanitizer's shadow is terabytes of address space, and UndefinedBehaviorSanitizer asks by a pipe whether memory can be read. */
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
enum { IS_SANITIZED = 1 };
#else
enum { IS_SANITIZED = 0 };
#endif

enum { FILES_MAX = 16 };

static bool limit(int resource, uint64_t soft, uint64_t hard)
{
	const struct rlimit value = {.rlim_cur = soft, .rlim_max = hard};
	return setrlimit((__rlimit_resource_t)resource, &value) == 0;
}

/* Address space that is taken already; 0 when that cannot be told. */
static uint64_t address_space(void)
{
	unsigned long pages = 0;
	FILE *file = fopen("/proc/self/statm", "re");
	if (!file)
		return 0;
	if (fscanf(file, "%lu", &pages) != 1)
		pages = 0;
	fclose(file);
	return (uint64_t)pages * (uint64_t)sysconf(_SC_PAGESIZE);
}

/* Of all processes this is the one to go when the machine's memory runs out. */
static void volunteer(void)
{
	const int fd = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
	if (fd >= 0 && write(fd, "1000", 4) < 0)
		errno = 0; /* only a wish */
	if (fd >= 0)
		close(fd);
}

static bool set_limits(const struct sandbox_limits *limits)
{
	const uint64_t taken = address_space();
	if (!IS_SANITIZED && (taken == 0 || !limit(RLIMIT_AS, taken + limits->memory_bytes, taken + limits->memory_bytes)))
		return false;
	return limit(RLIMIT_CPU, limits->cpu_seconds, limits->cpu_seconds + 1) && limit(RLIMIT_FSIZE, 0, 0) && limit(RLIMIT_CORE, 0, 0) &&
	       limit(RLIMIT_NOFILE, FILES_MAX, FILES_MAX);
}

/* --- the kernel's calls -------------------------------------------------------------------------------------------------------------- */

#if defined __x86_64__
#define THIS_ARCHITECTURE AUDIT_ARCH_X86_64
#elif defined __aarch64__
#define THIS_ARCHITECTURE AUDIT_ARCH_AARCH64
#endif

#ifdef THIS_ARCHITECTURE

/* Memory, the files that are open, time, and the end. Nothing that opens, starts or connects, and nothing that takes the number of a
 * process, which may be the daemon's. */
static const uint32_t allowed[] = {
	__NR_read,
	__NR_pread64,
	__NR_readv,
	__NR_preadv,
	__NR_write,
	__NR_lseek,
	__NR_fstat,
	__NR_close,
	__NR_munmap,
	__NR_mremap,
	__NR_brk,
	__NR_madvise,
	__NR_futex,
	__NR_clock_gettime,
	__NR_gettimeofday,
	__NR_clock_nanosleep,
	__NR_sched_yield,
	__NR_sched_getaffinity,
	__NR_getrandom,
	__NR_getpid,
	__NR_gettid,
	__NR_rt_sigaction,
	__NR_rt_sigprocmask,
	__NR_rt_sigreturn,
	__NR_sigaltstack,
	__NR_getrusage,
	__NR_restart_syscall,
	__NR_exit,
	__NR_exit_group,
};
static const uint32_t sanitizers_own[] = {
	__NR_pipe2,
#ifdef __NR_pipe
	__NR_pipe,
#endif
};
/* These too, but never for memory that is executed. */
static const uint32_t mapping[] = {__NR_mmap, __NR_mprotect};

enum {
	ALLOWED = sizeof allowed / sizeof *allowed,
	OWN = sizeof sanitizers_own / sizeof *sanitizers_own,
	MAPPING = sizeof mapping / sizeof *mapping
};

#define LOAD(member)           BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, member))
#define UNLESS(value, skipped) BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, skipped)
#define ANSWER(what)           BPF_STMT(BPF_RET | BPF_K, what)

static void filter_calls(void)
{
	struct sock_filter code[11 + 2 * (ALLOWED + OWN) + 5 * MAPPING];
	unsigned short n = 0;
	/* Numbers mean other calls on another architecture; those of x32 are numbers of x86-64 with a bit more, and not in the list. */
	code[n++] = (struct sock_filter)LOAD(arch);
	code[n++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, THIS_ARCHITECTURE, 1, 0);
	code[n++] = (struct sock_filter)ANSWER(SECCOMP_RET_KILL_PROCESS);
	code[n++] = (struct sock_filter)LOAD(nr);
	for (int i = 0; i < ALLOWED; i++) {
		code[n++] = (struct sock_filter)UNLESS(allowed[i], 1);
		code[n++] = (struct sock_filter)ANSWER(SECCOMP_RET_ALLOW);
	}
	for (int i = 0; IS_SANITIZED && i < OWN; i++) {
		code[n++] = (struct sock_filter)UNLESS(sanitizers_own[i], 1);
		code[n++] = (struct sock_filter)ANSWER(SECCOMP_RET_ALLOW);
	}
	/* abort() sends itself a signal; of another process the number is not taken. */
	code[n++] = (struct sock_filter)UNLESS(__NR_tgkill, 4);
	code[n++] = (struct sock_filter)LOAD(args[0]);
	code[n++] = (struct sock_filter)UNLESS((uint32_t)getpid(), 1);
	code[n++] = (struct sock_filter)ANSWER(SECCOMP_RET_ALLOW);
	code[n++] = (struct sock_filter)ANSWER(SECCOMP_RET_ERRNO | EPERM);
	for (int i = 0; i < MAPPING; i++) {
		code[n++] = (struct sock_filter)UNLESS(mapping[i], 4);
		code[n++] = (struct sock_filter)LOAD(args[2]);
		code[n++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, PROT_EXEC, 1, 0);
		code[n++] = (struct sock_filter)ANSWER(SECCOMP_RET_ALLOW);
		code[n++] = (struct sock_filter)ANSWER(SECCOMP_RET_ERRNO | EPERM);
	}
	code[n++] = (struct sock_filter)ANSWER(SECCOMP_RET_ERRNO | EPERM);
	const struct sock_fprog program = {.len = n, .filter = code};
	prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program);
}

#else

static void filter_calls(void)
{
}

#endif

bool sandbox_enter(const struct sandbox_limits *limits)
{
	volunteer();
	if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 || prctl(PR_SET_DUMPABLE, 0, 0, 0, 0) != 0 || !set_limits(limits))
		return false;
	filter_calls();
	return true;
}
