/* A C program that runs a system with libcosim, the C library inside libcosimpy's wheel. No Python in the host.
 *
 *     cc -std=c11 -o cosim_host cosim_host.c <libcosimc.so> -Wl,-rpath,<its folder>
 *     LD_PRELOAD=<libpython3.x.so> ./cosim_host SYSTEM.ssp COUNT RESULT
 *
 * Runs COUNT steps as the .ssp says. RESULT: a line "name name ...", then COUNT rows of doubles, the time and all real
 * outputs after each step. The wheel has no header: what is used of libcosimc 0.11 is declared here.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum { NAME = 1024, MOST = 1000, REAL = 0, OUTPUT = 2 };

typedef struct cosim_execution cosim_execution;
typedef struct cosim_observer cosim_observer;

typedef struct {
    char name[NAME];
    int index;
} cosim_slave_info;

typedef struct {
    char name[NAME];
    uint32_t reference;
    int type, causality, variability;
} cosim_variable_description;

typedef struct {
    int64_t current_time;
    int state, error_code;
    double total_average_real_time_factor, rolling_average_real_time_factor, real_time_factor_target;
    int is_real_time_simulation, steps_to_monitor;
} cosim_execution_status;

const char *cosim_last_error_message(void);
void cosim_log_set_output_level(int level);
cosim_execution *cosim_ssp_execution_create(const char *path, bool start_time_defined, int64_t start_time);
size_t cosim_execution_get_num_slaves(cosim_execution *execution);
int cosim_execution_get_slave_infos(cosim_execution *execution, cosim_slave_info infos[], size_t count);
int cosim_slave_get_num_variables(cosim_execution *execution, int slave);
int cosim_slave_get_variables(cosim_execution *execution, int slave, cosim_variable_description found[], size_t count);
cosim_observer *cosim_last_value_observer_create(void);
int cosim_execution_add_observer(cosim_execution *execution, cosim_observer *observer);
int cosim_execution_step(cosim_execution *execution, size_t count);
int cosim_execution_get_status(cosim_execution *execution, cosim_execution_status *status);
int cosim_observer_slave_get_real(cosim_observer *observer, int slave, const uint32_t variables[], size_t count,
                                  double values[]);
int cosim_execution_destroy(cosim_execution *execution);
int cosim_observer_destroy(cosim_observer *observer);

typedef struct {
    int index;
    size_t count;
    uint32_t output[MOST];
} Slave;

static void check(int good, const char *doing) {
    if (good) return;
    fprintf(stderr, "cosim_host: %s: %s\n", doing, cosim_last_error_message());
    exit(1);
}

static void list(cosim_execution *execution, const cosim_slave_info *info, Slave *slave, FILE *result) {
    static cosim_variable_description found[MOST];
    int count = cosim_slave_get_num_variables(execution, info->index);
    check(count >= 0 && count <= MOST, "number of variables");
    check(cosim_slave_get_variables(execution, info->index, found, count) == count, "variables");
    slave->index = info->index;
    for (int i = 0; i < count; i++) {
        if (found[i].type != REAL || found[i].causality != OUTPUT) continue;
        slave->output[slave->count++] = found[i].reference;
        fprintf(result, " %s.%s", info->name, found[i].name);
    }
}

static void write_row(cosim_execution *execution, cosim_observer *observer, const Slave *slaves, int count,
                      FILE *result) {
    double values[MOST];
    cosim_execution_status status;
    check(!cosim_execution_get_status(execution, &status), "status");
    values[0] = (double)status.current_time / 1e9;
    check(fwrite(values, sizeof(double), 1, result) == 1, "writing");
    for (const Slave *s = slaves; s < slaves + count; s++) {
        check(!cosim_observer_slave_get_real(observer, s->index, s->output, s->count, values), "reading outputs");
        check(fwrite(values, sizeof(double), s->count, result) == s->count, "writing");
    }
}

int main(int count, char **arguments) {
    static cosim_slave_info infos[10];
    static Slave slaves[10];
    FILE *result = count == 4 ? fopen(arguments[3], "wb") : NULL;
    check(result != NULL, "usage: cosim_host SYSTEM.ssp COUNT RESULT");
    cosim_log_set_output_level(3);
    cosim_execution *execution = cosim_ssp_execution_create(arguments[1], false, 0);
    check(execution != NULL, arguments[1]);
    int number = (int)cosim_execution_get_num_slaves(execution);
    check(number <= 10 && cosim_execution_get_slave_infos(execution, infos, number) == 0, "slaves");
    cosim_observer *observer = cosim_last_value_observer_create();
    check(observer && !cosim_execution_add_observer(execution, observer), "observer");
    fputs("time", result);
    for (int i = 0; i < number; i++) list(execution, &infos[i], &slaves[i], result);
    fputc('\n', result);
    for (int k = atoi(arguments[2]); k > 0; k--) {
        check(!cosim_execution_step(execution, 1), "step");
        write_row(execution, observer, slaves, number, result);
    }
    cosim_execution_destroy(execution);
    cosim_observer_destroy(observer);
    return fclose(result) ? 1 : 0;
}
