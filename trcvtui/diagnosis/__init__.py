"""Why a block shows what it shows, and what to check next."""
