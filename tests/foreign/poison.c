/* To be preloaded: memory that is freed is filled with ones, and never used again.
 *
 * A C++ shared_ptr released once too often then takes itself for the last owner and calls a destructor at an address
 * that is none, so that the process ends by SIGSEGV each time, and not once in a hundred times.
 */
#include <malloc.h>
#include <stddef.h>

void free(void *block) {
    int *words = block;
    if (!block) return;
    for (size_t i = 0; i < malloc_usable_size(block) / sizeof *words; i++) words[i] = 1;
}
