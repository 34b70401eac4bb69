// Builtin functions for a compiler without OpenCL's library. A call of a function that is not known would count as 16 KB
// of scratch and all registers.
#define INLINE __attribute__((overloadable, always_inline))
#define EACH(T)                                                                                                        \
    T INLINE min(T a, T b) { return a < b ? a : b; }                                                                   \
    T INLINE max(T a, T b) { return a > b ? a : b; }                                                                   \
    T INLINE clamp(T x, T a, T b) { return min(max(x, a), b); }
#define CONVERT(T, FROM)                                                                                               \
    T INLINE convert_##T(FROM x) { return (T)x; }
EACH(int)
EACH(uint)
EACH(long)
EACH(ulong)
CONVERT(float, int)
CONVERT(float, uint)
CONVERT(ulong, uint)
CONVERT(uint, ulong)
float INLINE fma(float a, float b, float c) { return __builtin_fmaf(a, b, c); }
// Of vectors, which stand only where V > 1: declared, never called.
#define DECLARED(T, I)                                                                                                 \
    T __attribute__((overloadable)) fma(T a, T b, T c);                                                                \
    T __attribute__((overloadable)) select(T a, T b, I c);
DECLARED(float8, int8)
DECLARED(float16, int16)
float INLINE fmin(float a, float b) { return __builtin_fminf(a, b); }
float INLINE fmax(float a, float b) { return __builtin_fmaxf(a, b); }
float INLINE fabs(float x) { return __builtin_fabsf(x); }
float INLINE ceil(float x) { return __builtin_ceilf(x); }
float INLINE rint(float x) { return __builtin_rintf(x); }
float INLINE select(float a, float b, int c) { return c ? b : a; }
int INLINE convert_int_rte(float x) { return (int)__builtin_rintf(x); }
uint INLINE abs(int x) { return x < 0 ? -x : x; }
uint INLINE abs_diff(int a, int b) { return a > b ? (uint)a - (uint)b : (uint)b - (uint)a; }
int INLINE popcount(int x) { return __builtin_popcount(x); }
uint INLINE popcount(uint x) { return __builtin_popcount(x); }
ulong INLINE popcount(ulong x) { return __builtin_popcountl(x); }
int INLINE mul_hi(int a, int b) { return (int)((long)a * b >> 32); }
uint INLINE mul_hi(uint a, uint b) { return (uint)((ulong)a * b >> 32); }
ulong INLINE mul_hi(ulong a, ulong b) { return (ulong)((unsigned __int128)a * b >> 64); }
int INLINE atomic_inc(volatile __global int *p) { return __atomic_fetch_add(p, 1, __ATOMIC_RELAXED); }
int INLINE atomic_inc(volatile __local int *p) { return __atomic_fetch_add(p, 1, __ATOMIC_RELAXED); }
int INLINE atomic_add(volatile __local int *p, int n) { return __atomic_fetch_add(p, n, __ATOMIC_RELAXED); }
#ifdef __AMDGCN__
#define GROUP_ID(axis) __builtin_amdgcn_workgroup_id_##axis()
#define LOCAL_ID(axis) __builtin_amdgcn_workitem_id_##axis()
#define BARRIER __builtin_amdgcn_s_barrier()
#else
#define GROUP_ID(axis) __nvvm_read_ptx_sreg_ctaid_##axis()
#define LOCAL_ID(axis) __nvvm_read_ptx_sreg_tid_##axis()
#define BARRIER __syncthreads()
#endif
#define ID(axis) GROUP_ID(axis) * 64 + LOCAL_ID(axis)
size_t INLINE get_global_id(uint axis) { return axis == 0 ? ID(x) : axis == 1 ? ID(y) : ID(z); }
size_t INLINE get_local_id(uint axis) { return axis == 0 ? LOCAL_ID(x) : axis == 1 ? LOCAL_ID(y) : LOCAL_ID(z); }
size_t INLINE get_group_id(uint axis) { return axis == 0 ? GROUP_ID(x) : axis == 1 ? GROUP_ID(y) : GROUP_ID(z); }
void INLINE barrier(cl_mem_fence_flags flags) { BARRIER; }
#undef EACH
