/* A host without Python: runs a plan of FMI 2 co-simulation FMUs, Jacobi, with a fixed step.
 *
 *     cc -std=c11 -o c_host -I <folder of fmi2Functions.h> c_host.c -ldl
 *     LD_PRELOAD=<libpython3.x.so> ./c_host PLAN RESULT
 *
 * PLAN, a text file:   run START STEP COUNT
 *                      fmu FOLDER MODEL_IDENTIFIER GUID     one line each, each followed by
 *                      output VALUE_REFERENCE               its outputs, numbered from 0 through all FMUs,
 *                      input VALUE_REFERENCE OUTPUT         and its inputs, each with the number of its source
 * RESULT: COUNT + 1 rows of doubles, all outputs at each communication point.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { MOST = 1000, PATH = 4096 };

typedef struct {
    void *library;
    fmi2Component instance;
    fmi2SetRealTYPE *set_real;
    fmi2GetRealTYPE *get_real;
    fmi2DoStepTYPE *do_step;
    int inputs, outputs, first; /* first: number of its first output */
    fmi2ValueReference input[MOST], output[MOST];
    int source[MOST];
} Fmu;

typedef struct {
    double start, step, row[MOST];
    int count, fmus, outputs;
    Fmu fmu[MOST];
} Plan;

static void fail(const char *doing, const char *why) {
    fprintf(stderr, "c_host: %s: %s\n", doing, why);
    exit(1);
}

static void check(fmi2Status status, const char *doing) {
    static const char *words[] = {"ok", "warning", "discard", "error", "fatal", "pending"};
    if (status > fmi2Warning) fail(doing, words[status]);
}

static void say(fmi2ComponentEnvironment unused, fmi2String name, fmi2Status status, fmi2String category,
                fmi2String message, ...) {
    va_list arguments;
    (void)unused;
    if (status <= fmi2Warning) return;
    fprintf(stderr, "%s [%s]: ", name, category);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static void *function(Fmu *fmu, const char *name) {
    void *found = dlsym(fmu->library, name);
    if (!found) fail(name, dlerror());
    return found;
}

static void load(Fmu *fmu, const char *folder, const char *identifier, const char *guid) {
    static const fmi2CallbackFunctions callbacks = {say, calloc, free, NULL, NULL};
    char path[3 * PATH], resources[3 * PATH];
    snprintf(path, sizeof path, "%s/binaries/linux64/%s.so", folder, identifier);
    snprintf(resources, sizeof resources, "file://%s/resources", folder);
    fmu->library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!fmu->library) fail(path, dlerror());
    fmu->set_real = function(fmu, "fmi2SetReal");
    fmu->get_real = function(fmu, "fmi2GetReal");
    fmu->do_step = function(fmu, "fmi2DoStep");
    fmi2InstantiateTYPE *instantiate = function(fmu, "fmi2Instantiate");
    fmu->instance = instantiate(identifier, fmi2CoSimulation, guid, resources, &callbacks, fmi2False, fmi2True);
    if (!fmu->instance) fail(identifier, "no instance");
}

static int read_fmu(Plan *plan, FILE *file) {
    char folder[PATH], identifier[PATH], guid[PATH];
    if (plan->fmus == MOST || fscanf(file, "%4095s %4095s %4095s", folder, identifier, guid) != 3) return 0;
    Fmu *fmu = &plan->fmu[plan->fmus++];
    fmu->first = plan->outputs;
    load(fmu, folder, identifier, guid);
    return 1;
}

static int read_line(Plan *plan, FILE *file, const char *word) {
    Fmu *fmu = plan->fmus ? &plan->fmu[plan->fmus - 1] : NULL;
    if (!strcmp(word, "run")) return fscanf(file, "%lf %lf %d", &plan->start, &plan->step, &plan->count) == 3;
    if (!strcmp(word, "fmu")) return read_fmu(plan, file);
    if (!fmu || plan->outputs == MOST || fmu->inputs == MOST) return 0;
    if (!strcmp(word, "output")) {
        plan->outputs++;
        return fscanf(file, "%u", &fmu->output[fmu->outputs++]) == 1;
    }
    if (strcmp(word, "input") || fscanf(file, "%u %d", &fmu->input[fmu->inputs], &fmu->source[fmu->inputs]) != 2)
        return 0;
    return fmu->source[fmu->inputs++] < MOST;
}

static void read_plan(Plan *plan, const char *name) {
    char word[PATH];
    FILE *file = fopen(name, "r");
    if (!file) fail(name, "cannot be opened");
    while (fscanf(file, "%4095s", word) == 1)
        if (!read_line(plan, file, word)) fail(name, word);
    fclose(file);
}

static void send(Plan *plan) {
    double values[MOST];
    for (Fmu *f = plan->fmu; f < plan->fmu + plan->fmus; f++) {
        for (int i = 0; i < f->inputs; i++) values[i] = plan->row[f->source[i]];
        if (f->inputs) check(f->set_real(f->instance, f->input, f->inputs, values), "fmi2SetReal");
    }
}

static void fetch(Plan *plan) {
    for (Fmu *f = plan->fmu; f < plan->fmu + plan->fmus; f++)
        check(f->get_real(f->instance, f->output, f->outputs, plan->row + f->first), "fmi2GetReal");
}

static void write_row(Plan *plan, FILE *result) {
    size_t count = plan->outputs;
    if (fwrite(plan->row, sizeof(double), count, result) != count) fail("result", "cannot be written");
}

static void initialize(Plan *plan) {
    double stop = plan->start + plan->count * plan->step;
    for (Fmu *f = plan->fmu; f < plan->fmu + plan->fmus; f++) {
        fmi2SetupExperimentTYPE *setup = function(f, "fmi2SetupExperiment");
        fmi2EnterInitializationModeTYPE *enter = function(f, "fmi2EnterInitializationMode");
        check(setup(f->instance, fmi2False, 0.0, plan->start, fmi2True, stop), "fmi2SetupExperiment");
        check(enter(f->instance), "fmi2EnterInitializationMode");
    }
    for (int round = 0; round < plan->fmus; round++) fetch(plan), send(plan);
    for (Fmu *f = plan->fmu; f < plan->fmu + plan->fmus; f++) {
        fmi2ExitInitializationModeTYPE *leave = function(f, "fmi2ExitInitializationMode");
        check(leave(f->instance), "fmi2ExitInitializationMode");
    }
    fetch(plan);
}

static void finish(Plan *plan) {
    for (Fmu *f = plan->fmu; f < plan->fmu + plan->fmus; f++) {
        fmi2TerminateTYPE *terminate = function(f, "fmi2Terminate");
        check(terminate(f->instance), "fmi2Terminate");
    }
    for (Fmu *f = plan->fmu; f < plan->fmu + plan->fmus; f++) {
        fmi2FreeInstanceTYPE *release = function(f, "fmi2FreeInstance");
        release(f->instance);
        dlclose(f->library);
    }
}

/* If the Python that was preloaded has a word to say (PYTHON_SAYS), let it. */
static void python_says(const char *code) {
    int (*run)(const char *) = dlsym(RTLD_DEFAULT, "PyRun_SimpleString");
    int (*ensure)(void) = dlsym(RTLD_DEFAULT, "PyGILState_Ensure");
    void (*release)(int) = dlsym(RTLD_DEFAULT, "PyGILState_Release");
    if (!code || !run || !ensure || !release) return;
    int state = ensure();
    if (run(code)) fail("PYTHON_SAYS", "raised");
    release(state);
}

int main(int count, char **arguments) {
    static Plan plan;
    if (count != 3) fail("usage", "c_host PLAN RESULT");
    read_plan(&plan, arguments[1]);
    FILE *result = fopen(arguments[2], "wb");
    if (!result) fail(arguments[2], "cannot be opened");
    initialize(&plan);
    write_row(&plan, result);
    for (int k = 0; k < plan.count; k++) {
        send(&plan);
        for (Fmu *f = plan.fmu; f < plan.fmu + plan.fmus; f++)
            check(f->do_step(f->instance, plan.start + k * plan.step, plan.step, fmi2True), "fmi2DoStep");
        fetch(&plan);
        write_row(&plan, result);
    }
    python_says(getenv("PYTHON_SAYS"));
    finish(&plan);
    return fclose(result) ? 1 : 0;
}
