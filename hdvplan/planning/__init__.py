"""Planning: from stations and objective to one QP per step."""
